# Reference values of `analysis pairs`: Rscript tests/golden/r/pairs.R, from the repository's root. R 4.2, base packages.
# Bradley-Terry and Thurstone are binomial models (glm); Davidson's model is a Poisson log-linear one with a row effect
# a pair: log m(left) = pair + l + d/2, log m(right) = pair + r - d/2, log m(tie) = pair + log nu + (l + r)/2.
library(jsonlite)
folder <- "tests/golden/r/pairs"
set.seed(20261121)

simulate <- function(items, people, ability, nu, delta, file) {
  pairs <- t(combn(items, 2)); rows <- list()
  for (p in seq_len(people)) for (i in seq_len(nrow(pairs))) {
    if (runif(1) < 0.15) next
    s <- if (runif(1) < 0.5) pairs[i, ] else rev(pairs[i, ])
    l <- ability[s[1]] + rnorm(1, 0, 0.3); r <- ability[s[2]]
    w <- c(exp(l + delta / 2), exp(r - delta / 2), nu * exp((l + r) / 2))
    rows[[length(rows) + 1]] <- data.frame(id = sprintf("%03d", p), a = s[1], b = s[2],
      choice = sample(c("left", "right", "same"), 1, prob = w))
  }
  data <- do.call(rbind, rows)
  write.csv(data, file, row.names = FALSE, quote = FALSE)
  read.csv(file, colClasses = "character")
}

design <- function(data, items) {
  l <- outer(data$a, items, "==") * 1; r <- outer(data$b, items, "==") * 1
  list(left = l[, -1, drop = FALSE], right = r[, -1, drop = FALSE])
}

robust <- function(scores, covariance, id) {
  s <- rowsum(scores, id); g <- nrow(s)
  sqrt(diag(covariance %*% crossprod(s) %*% covariance) * g / (g - 1))
}

binomial_fit <- function(data, items, link, order = FALSE) {
  d <- design(data, items); x <- d$left - d$right; y <- as.numeric(data$choice == "left")
  if (order) x <- cbind(x, 1)
  m <- glm(y ~ x - 1, family = binomial(link), control = list(epsilon = 1e-14, maxit = 100))
  mu <- fitted(m); deriv <- m$family$mu.eta(m$linear.predictors)
  list(ability = c(0, unname(coef(m)))[seq_along(items)], se = c(0, unname(sqrt(diag(vcov(m)))))[seq_along(items)],
       order = if (order) unname(tail(coef(m), 1)) else NULL,
       robust = c(0, unname(robust(x * ((y - mu) * deriv / (mu * (1 - mu))), vcov(m), data$id)))[seq_along(items)],
       logLik = as.numeric(logLik(m)))
}

davidson_fit <- function(data, items, order = FALSE) {
  pair <- paste(data$a, data$b); keys <- unique(pair); long <- list()
  for (k in keys) {
    one <- data[pair == k, ][1, ]; d <- design(one, items); n <- table(factor(data$choice[pair == k], c("left", "right", "same")))
    z <- rbind(c(d$left, 0.5, 0), c(d$right, -0.5, 0), c((d$left + d$right) / 2, 0, 1))
    long[[k]] <- data.frame(pair = k, n = as.numeric(n), z)
  }
  long <- do.call(rbind, long); z <- as.matrix(long[, -(1:2)]); colnames(z) <- NULL
  if (!order) z <- z[, -(ncol(z) - 1)]
  m <- glm(long$n ~ factor(long$pair) + z - 1, family = poisson, control = list(epsilon = 1e-14, maxit = 100))
  keep <- grep("^z", names(coef(m))); est <- unname(coef(m)[keep]); v <- vcov(m)[keep, keep]
  p <- length(items) - 1
  total <- ave(long$n, long$pair, FUN = sum); prob <- fitted(m) / total
  list(ability = c(0, est[1:p]), se = c(0, unname(sqrt(diag(v)))[1:p]), logNu = tail(est, 1), logNuSe = unname(sqrt(diag(v)))[length(est)],
       order = if (order) est[p + 1] else NULL, logLik = sum(long$n * log(prob)))
}

items <- c("007", "012", "blur", "cartoon", "x 5")
ability <- setNames(c(0, 0.4, -0.5, 0.9, 1.3), items)
plain <- simulate(items, 24, ability, 0, 0.3, file.path(folder, "plain.csv"))
ties <- simulate(items, 24, ability, 0.6, 0.4, file.path(folder, "ties.csv"))
factors <- data.frame(item = items, speed = c("slow", "slow", "fast", "fast", "slow"), style = c("a", "b", "a", "b", "b"))
write.csv(factors, file.path(folder, "items.csv"), row.names = FALSE, quote = FALSE)
x <- model.matrix(~ speed + style, factors)[, -1]; d <- design(plain, items)
l <- outer(plain$a, items, "==") * 1; r <- outer(plain$b, items, "==") * 1; y <- as.numeric(plain$choice == "left")
fm <- glm(y ~ I((l - r) %*% x) - 1, family = binomial, control = list(epsilon = 1e-14))

write(toJSON(list(
  items = items, R = R.version.string,
  bradley_terry = binomial_fit(plain, items, "logit"), bradley_terry_order = binomial_fit(plain, items, "logit", TRUE),
  thurstone = binomial_fit(plain, items, "probit"),
  davidson = davidson_fit(ties, items), davidson_order = davidson_fit(ties, items, TRUE),
  factors = list(estimates = unname(coef(fm)), se = unname(sqrt(diag(vcov(fm)))), logLik = as.numeric(logLik(fm)))
), digits = 14, auto_unbox = TRUE), file.path(folder, "reference.json"))
