# Tests of means without equal variances, one-sample tests, Conover's tests and equivalence, by base R.
# On the values of ranks.json. Run here: Rscript t_tests.R
library(jsonlite)
known <- fromJSON("ranks.json", simplifyMatrix = FALSE, simplifyVector = TRUE)
y <- known$groups_tied$values; g <- known$groups_tied$groups
names <- c("old", "mid", "new"); bounds <- c(-0.5, 0.8)
pairs <- combn(names, 2, simplify = FALSE)
tost <- function(t, df, se, d) max(pt(-(d - bounds[1]) / se, df), pt((d - bounds[2]) / se, df))
welch <- oneway.test(y ~ factor(g, names), var.equal = FALSE)
of_pair <- function(p) {
  a <- y[g == p[1]]; b <- y[g == p[2]]; w <- t.test(a, b)
  d <- mean(a) - mean(b); se <- w$stderr; df <- unname(w$parameter)
  pooled <- sqrt(((length(a) - 1) * var(a) + (length(b) - 1) * var(b)) / (length(a) + length(b) - 2))
  list(t = unname(w$statistic), df = df, p = w$p.value, low = w$conf.int[1], high = w$conf.int[2], d = d / pooled,
       games_howell = ptukey(abs(w$statistic) * sqrt(2), 3, df, lower.tail = FALSE), tost = tost(w$statistic, df, se, d))
}
one <- t.test(y, mu = 3.5)
rank_tost <- function(a, b, ...) max(
  suppressWarnings(wilcox.test(a, b, mu = bounds[1], alternative = "greater", ...))$p.value,
  suppressWarnings(wilcox.test(a, b, mu = bounds[2], alternative = "less", ...))$p.value)
conover_between <- function(y) {
  r <- rank(y); n <- table(g)[names]; N <- length(y); h <- kruskal.test(y, factor(g))$statistic
  s2 <- var(r) * (N - 1 - h) / (N - 3)
  t <- sapply(pairs, function(p) (mean(r[g == p[1]]) - mean(r[g == p[2]])) / sqrt(s2 * (1 / n[[p[1]]] + 1 / n[[p[2]]])))
  list(t = t, p = p.adjust(2 * pt(-abs(t), N - 3), "holm"))
}
conover_within <- function(rows) {
  y <- do.call(rbind, rows); r <- t(apply(y, 1, rank)); b <- nrow(y); k <- ncol(y); s <- colSums(r)
  df <- (b - 1) * (k - 1); error <- sqrt(2 * (b * sum(r^2) - sum(s^2)) / df)
  t <- apply(combn(k, 2), 2, function(p) (s[p[1]] - s[p[2]]) / error)
  list(t = t, p = p.adjust(2 * pt(-abs(t), df), "holm"))
}
tied <- do.call(rbind, known$tied$values); smooth <- do.call(rbind, known$untied$values)
signed <- function(x) { w <- suppressWarnings(wilcox.test(x, mu = 3.5)); list(v = unname(w$statistic), p = w$p.value) }
exact <- known$groups_untied$values
result <- list(
  provenance = list(r = R.version.string, command = "Rscript t_tests.R", date = format(Sys.Date())),
  bounds = bounds,
  welch = list(f = unname(welch$statistic), df1 = unname(welch$parameter[1]), df2 = unname(welch$parameter[2]), p = welch$p.value),
  pairs = lapply(pairs, of_pair),
  one_sample = list(value = 3.5, t = unname(one$statistic), p = one$p.value, tost = {d <- mean(y) - 3.5; tost(0, length(y) - 1, one$stderr, d)}),
  signed_ranks = list(tied = signed(y), untied = signed(exact)),
  conover_groups = conover_between(y), conover_untied = conover_between(exact),
  conover_tied = conover_within(known$tied$values), conover_smooth = conover_within(known$untied$values),
  tost_groups = rank_tost(y[g == "old"], y[g == "mid"]), tost_untied = rank_tost(exact[g == "old"], exact[g == "mid"]),
  tost_within = rank_tost(smooth[, 1], smooth[, 2], paired = TRUE), tost_tied = rank_tost(tied[, 1], tied[, 2], paired = TRUE))
write(toJSON(result, auto_unbox = TRUE, digits = NA), "t_tests.json")
