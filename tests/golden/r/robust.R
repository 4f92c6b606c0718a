# Golden results of the robust companions: writes robust.csv and robust.json. Run from this folder: Rscript robust.R
# Ranks are aligned here by tapply and tested by afex; permutations refit aov or lm to every rearrangement; trimmed
# means are mean(trim = ) with Yuen's errors written out.
suppressPackageStartupMessages({ library(afex); library(jsonlite) })
set.seed(20111)
n <- 10
d <- expand.grid(id = sprintf("p%02d", 1:n), a = c("a1", "a2", "a3"), b = c("b1", "b2"), stringsAsFactors = FALSE)
d$g <- ifelse(as.integer(sub("p", "", d$id)) <= 4, "g1", "g2")
d$y <- round(4 + (d$a == "a2") * .8 + (d$g == "g2") * (d$b == "b2") + rexp(nrow(d)) + rnorm(n)[as.integer(sub("p", "", d$id))], 2)
write.csv(d, "robust.csv", row.names = FALSE, quote = FALSE)

number <- function(x) unbox(as.numeric(x))
cell <- ave(d$y, d$g, d$a, d$b)
means <- tapply(d$y, d[c("g", "a", "b")], mean)
estimate <- function(set) {
  total <- 0
  for (size in 0:length(set)) for (kept in combn(set, size, simplify = FALSE)) {
    part <- if (size == 0) mean(means) else {
      m <- apply(means, kept, mean)
      m[as.matrix(d[kept])]
    }
    total <- total + (-1)^(length(set) - size) * part
  }
  total
}
sets <- list("g", "a", "b", c("g", "a"), c("g", "b"), c("a", "b"), c("g", "a", "b"))
ranks <- lapply(sets, function(set) {
  d$r <- rank(round(d$y - cell + estimate(set), 9))
  t <- anova(suppressMessages(aov_ez("id", "r", d, within = c("a", "b"), between = "g", type = 3)), correction = "none")
  row <- t[paste(set, collapse = ":"), ]
  list(effect = unbox(paste(set, collapse = ":")), f_value = number(row$F), df_effect = number(row[["num Df"]]),
    df_error = number(row[["den Df"]]), p_value = number(row[["Pr(>F)"]]))
})

small <- d[d$id <= "p08", ]
small$id <- factor(small$id)
people <- levels(small$id)
within_f <- function(y, effect) {
  s <- summary(aov(y ~ a * b + Error(id / (a * b)), cbind(small[c("id", "a", "b")], y = y)))
  stratum <- s[[paste0("Error: id:", effect)]][[1]]
  stratum[1, "F value"]
}
# flipping a participant flips the deviations from the participant's mean and keeps the mean
flip_p <- function(effect) {
  centre <- ave(small$y, small$id)
  signs <- as.matrix(expand.grid(rep(list(c(1, -1)), length(people))))
  f <- apply(signs, 1, function(s) within_f(centre + (small$y - centre) * s[as.integer(small$id)], effect))
  mean(f >= f[1] * (1 - 1e-9))
}
flips <- lapply(c("a", "b", "a:b"), function(e) list(effect = unbox(e), p_value = number(flip_p(e))))

# Freedman-Lane: seven people, a group tested beside a covariate
seven <- aggregate(y ~ id + g, d[d$id <= "p07", ], mean)
seven$x <- c(21, 34, 27, 45, 30, 52, 38)
orders <- function(v) if (length(v) <= 1) list(v) else do.call(c, lapply(seq_along(v), function(i) lapply(orders(v[-i]), function(o) c(v[i], o))))
reduced <- lm(y ~ x, seven)
f_of <- function(values) {
  seven$y <- values
  anova(lm(y ~ x, seven), lm(y ~ x + g, seven))$F[2]
}
f <- sapply(orders(1:7), function(o) f_of(fitted(reduced) + residuals(reduced)[o]))
lane <- list(f_value = number(f_of(seven$y)), p_value = number(mean(f >= f_of(seven$y) * (1 - 1e-9))), x = seven$x)

winsor <- function(v, g) { s <- sort(v); pmin(pmax(v, s[g + 1]), s[length(v) - g]) }
yuen <- function(x, y) {
  k <- length(x); g <- floor(.2 * k); h <- k - 2 * g
  s <- cov(cbind(winsor(x, g), winsor(y, g)))
  se <- sqrt((k - 1) * (s[1, 1] + s[2, 2] - 2 * s[1, 2]) / (h * (h - 1)))
  t <- (mean(x, trim = .2) - mean(y, trim = .2)) / se
  list(difference = number(mean(x, trim = .2) - mean(y, trim = .2)), se = number(se), t = number(t), df = number(h - 1),
    p = number(2 * pt(-abs(t), h - 1)))
}
m <- tapply(d$y, d[c("id", "a")], mean)
pairs <- list(yuen(m[, 1], m[, 2]), yuen(m[, 1], m[, 3]), yuen(m[, 2], m[, 3]))

writeLines(toJSON(list(
  provenance = list(R = unbox(R.version.string), afex = unbox(as.character(packageVersion("afex"))),
    command = unbox("Rscript robust.R"), date = unbox(format(Sys.Date()))),
  ranks = ranks, flips = flips, lane = lane, pairs = pairs
), digits = I(17)), "robust.json")
