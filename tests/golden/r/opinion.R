# Reference values of `analysis opinion`: Rscript tests/golden/r/opinion.R from the repository's root. Base R.
# The subject model is maximised directly (u ~ N(psi_j + Delta_i, upsilon_i^2), joint maximum likelihood by its own fixed
# point in R), not by the project's code.
library(jsonlite)
folder <- "tests/golden/r/opinion"
set.seed(3)
people <- sprintf("%02d", 1:18); clips <- paste0("clip", 1:9)
quality <- seq(1.5, 4.7, length.out = 9); bias <- rnorm(18, 0, 0.5); spread <- runif(18, 0.2, 1.1)
data <- expand.grid(id = people, clip = clips, stringsAsFactors = FALSE)
data$score <- round(pmin(5, pmax(1, quality[match(data$clip, clips)] + bias[match(data$id, people)] + rnorm(nrow(data)) * spread[match(data$id, people)])))
data <- data[-c(5, 40, 77), ]
write.csv(data, file.path(folder, "votes.csv"), row.names = FALSE, quote = FALSE)
items <- lapply(split(data$score, data$clip), function(u) { t <- t.test(u); list(mos = mean(u), sd = sd(u), n = length(u), low = t$conf.int[1], high = t$conf.int[2]) })
subject_model <- function(data) {
  i <- match(data$id, people); j <- match(data$clip, clips); u <- data$score
  psi <- tapply(u, j, mean)
  for (step in 1:5000) {
    delta <- tapply(u - psi[j], i, mean); delta <- delta - mean(delta)
    r <- u - psi[j] - delta[i]; ups <- sqrt(tapply(r, i, function(z) mean((z - mean(z))^2)))
    w <- 1 / ups[i]^2; psi <- tapply(w * (u - delta[i]), j, sum) / tapply(w, j, sum)
  }
  # P.910: the standard deviation (over n) of an item's votes without the biases, over the root of n
  se <- tapply(u - delta[i], j, function(e) sqrt(mean((e - mean(e))^2) / length(e)))
  list(psi = unname(c(psi)), se = unname(c(se)), bias = unname(c(delta)), inconsistency = unname(c(ups)))
}
# votes given again, for some of them and not alike: each counts
again <- data[sample(nrow(data), 60), ]
again$score <- pmin(5, pmax(1, again$score + sample(-1:1, 60, TRUE)))
repeated <- rbind(data, again)
write.csv(repeated, file.path(folder, "repeated.csv"), row.names = FALSE, quote = FALSE)
write(toJSON(c(list(R = R.version.string, items = items), subject_model(data), list(repeated = subject_model(repeated))),
  digits = 14, auto_unbox = TRUE), file.path(folder, "reference.json"))
