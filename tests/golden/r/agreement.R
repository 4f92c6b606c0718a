# Reference values of `analysis reliability` and `analysis agreement`: Rscript tests/golden/r/agreement.R from the repository's
# root. Base R: alpha and Feldt's interval by their formulas, omega from factanal, intraclass correlations from aov's mean squares
# (McGraw & Wong 1996, tables 4, 5 and 7), Krippendorff's alpha from pairs of values as in Krippendorff (2011), not by the library.
library(jsonlite)
folder <- "tests/golden/r/agreement"
set.seed(8)
n <- 60; trait <- rnorm(n); weights <- c(1.2, 0.9, -1.0, 0.6, 0.8); noise <- c(0.7, 0.9, 0.8, 1.1, 0.6)
answers <- sapply(1:5, function(i) round(pmin(7, pmax(1, 4 + weights[i] * trait + rnorm(n) * noise[i]))))
colnames(answers) <- c("calm", "glad", "tense", "awake", "warm")
write.csv(data.frame(id = sprintf("%02d", 1:n), answers), file.path(folder, "items.csv"), row.names = FALSE, quote = FALSE)
x <- answers; x[, 3] <- 8 - x[, 3]; k <- ncol(x)
alpha_of <- function(x) { k <- ncol(x); k / (k - 1) * (1 - sum(apply(x, 2, var)) / var(rowSums(x))) }
alpha <- alpha_of(x); df1 <- n - 1; df2 <- (n - 1) * (k - 1)
feldt <- c(1 - (1 - alpha) * qf(0.975, df1, df2), 1 - (1 - alpha) * qf(0.025, df1, df2))
fit <- factanal(x, 1, control = list(opt = list(factr = 10)))
l <- fit$loadings[, 1]; l <- l * sign(sum(l)); s <- apply(x, 2, sd)
omega <- sum(l * s)^2 / (sum(l * s)^2 + sum(fit$uniquenesses * s^2))
rest <- sapply(1:k, function(i) cor(x[, i], rowSums(x[, -i])))
without <- sapply(1:k, function(i) alpha_of(x[, -i]))

people <- sprintf("p%02d", 1:8); clips <- sprintf("c%02d", 1:12)
votes <- expand.grid(id = people, clip = clips, stringsAsFactors = FALSE)
quality <- rnorm(12); lean <- rnorm(8, 0, 0.5)
votes$score <- round(pmin(7, pmax(1, 4 + 1.3 * quality[match(votes$clip, clips)] + lean[match(votes$id, people)] + rnorm(96, 0, 0.8))))
votes <- votes[-c(3, 60), ]
write.csv(votes, file.path(folder, "votes.csv"), row.names = FALSE, quote = FALSE)
whole <- tapply(votes$score, list(votes$clip, votes$id), mean)
full <- whole[complete.cases(whole), ]; r <- nrow(full); c <- ncol(full)
long <- data.frame(y = c(full), item = factor(rep(rownames(full), c)), person = factor(rep(colnames(full), each = r)))
ms <- summary(aov(y ~ item + person, long))[[1]][["Mean Sq"]]; msr <- ms[1]; msc <- ms[2]; mse <- ms[3]
msw <- summary(aov(y ~ item, long))[[1]][["Mean Sq"]][2]
icc <- list("ICC(1,1)" = (msr - msw) / (msr + (c - 1) * msw), "ICC(A,1)" = (msr - mse) / (msr + (c - 1) * mse + c / r * (msc - mse)),
  "ICC(C,1)" = (msr - mse) / (msr + (c - 1) * mse), "ICC(1,k)" = (msr - msw) / msr,
  "ICC(A,k)" = (msr - mse) / (msr + (msc - mse) / r), "ICC(C,k)" = (msr - mse) / msr)
f <- msr / mse; fl <- f / qf(0.975, r - 1, (r - 1) * (c - 1)); fu <- f * qf(0.975, (r - 1) * (c - 1), r - 1)
consistency <- c((fl - 1) / (fl + c - 1), (fu - 1) / (fu + c - 1))
krippendorff <- function(level) {
  values <- sort(unique(na.omit(c(whole)))); o <- matrix(0, length(values), length(values))
  for (unit in 1:nrow(whole)) { v <- na.omit(whole[unit, ]); m <- length(v)
    for (a in seq_along(v)) for (b in seq_along(v)) if (a != b) { i <- match(v[a], values); j <- match(v[b], values); o[i, j] <- o[i, j] + 1 / (m - 1) } }
  nc <- rowSums(o); total <- sum(nc)
  d <- outer(seq_along(values), seq_along(values), Vectorize(function(i, j) switch(level, nominal = as.numeric(i != j),
    ordinal = (sum(nc[min(i, j):max(i, j)]) - (nc[i] + nc[j]) / 2)^2, interval = (values[i] - values[j])^2,
    ratio = ((values[i] - values[j]) / (values[i] + values[j]))^2)))
  1 - sum(o * d) / (sum(outer(nc, nc) * d) / (total - 1))
}
write(toJSON(list(R = R.version.string, alpha = alpha, feldt = feldt, omega = omega, loadings = unname(l), rest = rest, without = without,
  icc = icc, consistency = consistency, krippendorff = sapply(c(nominal = "nominal", ordinal = "ordinal", interval = "interval", ratio = "ratio"),
  function(level) list(krippendorff(level)))), digits = 14, auto_unbox = TRUE), file.path(folder, "reference.json"))
