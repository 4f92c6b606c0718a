# Reference values of `analysis thresholds`: Rscript tests/golden/r/thresholds.R from the repository's root. Base R.
# Yes/no functions are binomial models (glm); with a guess rate or a lapse rate the likelihood is maximised by nlm from
# many starts, and profiled by uniroot, which shares no code with the project.
library(jsonlite)
folder <- "tests/golden/r/thresholds"
set.seed(7)

F <- list(normal = function(x, a, b) pnorm((x - a) / b), logistic = function(x, a, b) plogis((x - a) / b),
          weibull = function(x, a, b) 1 - 2^(-(x / a)^b))

make <- function(file, shape, a, b, guess, lapse, levels, n) {
  x <- rep(levels, each = n)
  p <- guess + (1 - guess - lapse) * F[[shape]](x, a, b)
  data <- data.frame(duration = x, seen = rbinom(length(x), 1, p))
  write.csv(data, file.path(folder, file), row.names = FALSE, quote = FALSE)
  data
}

negative <- function(shape, data, guess, lapse) function(v, a = NULL) {
  loc <- if (is.null(a)) v[1] else a; logb <- if (is.null(a)) v[2] else v[1]
  l <- if (is.na(lapse)) 0.1 * plogis(tail(v, 1)) else lapse
  if (shape == "weibull" && loc <= 0) return(1e10)
  p <- guess + (1 - guess - l) * F[[shape]](data$duration, loc, exp(logb))
  p <- pmin(pmax(p, 1e-12), 1 - 1e-12)
  -sum(data$seen * log(p) + (1 - data$seen) * log(1 - p))
}

best <- function(f, starts) {
  fits <- lapply(starts, function(s) { o <- optim(s, f, control = list(maxit = 5000, reltol = 1e-15)); optim(o$par, f, method = "BFGS", control = list(maxit = 5000, reltol = 1e-16)) })
  fits[[which.min(sapply(fits, function(o) o$value))]]
}

fit <- function(data, shape, guess, lapse, a, b) {
  extra <- if (is.na(lapse)) 0 else NULL
  f <- negative(shape, data, guess, lapse)
  o <- best(f, list(c(a, log(b), extra), c(a * 1.2, log(b) - 0.5, extra), c(a * 0.8, log(b) + 0.5, extra)))
  loss <- function(at) 2 * (best(function(v) f(v, at), list(o$par[-1], c(log(b), extra)))$value - o$value) - qchisq(0.95, 1)
  w <- diff(range(data$duration))
  list(threshold = o$par[1], spread = exp(o$par[2]), lapse = if (is.na(lapse)) 0.1 * plogis(o$par[3]) else lapse,
       logLik = -o$value, low = uniroot(loss, c(o$par[1] - w, o$par[1]), tol = 1e-10, extendInt = "no")$root,
       high = uniroot(loss, c(o$par[1], o$par[1] + w), tol = 1e-10)$root)
}

yes <- make("yes_no.csv", "normal", 6.5, 1.8, 0, 0, c(2, 4, 5, 6, 7, 8, 10, 12), 20)
afc <- make("two_afc.csv", "weibull", 6, 2.5, 0.5, 0.03, c(1.5, 3, 4.5, 6, 8, 11, 15), 150)
log <- make("logistic.csv", "logistic", 30, 6, 0, 0.04, seq(5, 60, 5), 25)
g <- glm(seen ~ duration, binomial("probit"), yes, control = list(epsilon = 1e-14))
k <- coef(g); v <- vcov(g); grad <- c(-1 / k[2], k[1] / k[2]^2)

write(toJSON(list(R = R.version.string,
  glm = list(threshold = unname(-k[1] / k[2]), spread = unname(1 / k[2]), se = sqrt(as.numeric(t(grad) %*% v %*% grad)), logLik = as.numeric(logLik(g))),
  yes_no = fit(yes, "normal", 0, 0, 6, 2), two_afc = fit(afc, "weibull", 0.5, 0, 6, 2.5), two_afc_lapse = fit(afc, "weibull", 0.5, NA, 6, 2.5),
  logistic_lapse = fit(log, "logistic", 0, NA, 30, 6)), digits = 12, auto_unbox = TRUE), file.path(folder, "reference.json"))
