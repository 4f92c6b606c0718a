# Reference values of a threshold that is a line over a second variable: Rscript tests/golden/r/plane.R from the
# repository's root. Base R. Without guess and lapse rates it is a binomial model (glm); with them the likelihood is
# maximised by optim, and profiled by uniroot, which shares no code with the project.
library(jsonlite)
folder <- "tests/golden/r/plane"
set.seed(11)

make <- function(file, t, b, s, guess, lapse, n) {
  grid <- expand.grid(duration = seq(100, 600, 100), asymmetry = c(0, 0.25, 0.5, 1))
  data <- grid[rep(seq_len(nrow(grid)), each = n), ]
  p <- guess + (1 - guess - lapse) * pnorm((data$duration - t - b * (data$asymmetry - 0.5)) / s)
  data$seen <- rbinom(nrow(data), 1, p)
  write.csv(data, file.path(folder, file), row.names = FALSE, quote = FALSE)
  data
}

fit <- function(data, guess, lapse) {
  z <- data$asymmetry - 0.5
  f <- function(v) {
    p <- guess + (1 - guess - lapse) * pnorm((data$duration - 100 * v[1] - 100 * v[2] * z) / (100 * exp(v[3])))
    p <- pmin(pmax(p, 1e-12), 1 - 1e-12)
    -sum(data$seen * log(p) + (1 - data$seen) * log(1 - p))
  }
  best <- function(g, start) {
    o <- optim(start, g, control = list(maxit = 20000, reltol = 1e-16))
    for (turn in 1:3) o <- optim(o$par, g, method = "BFGS", control = list(maxit = 5000, reltol = 1e-16))
    o
  }
  o <- best(f, c(3.5, 0.5, -0.3))
  ends <- function(place, step) {
    loss <- function(at) {
      g <- function(v) { full <- numeric(3); full[place] <- at; full[-place] <- v; f(full) }
      2 * (best(g, o$par[-place])$value - o$value) - qchisq(0.95, 1)
    }
    here <- o$par[place]
    c(uniroot(loss, c(here - step, here), tol = 1e-9)$root, uniroot(loss, c(here, here + step), tol = 1e-9)$root)
  }
  list(threshold = 100 * o$par[1], tilt = 100 * o$par[2], spread = 100 * exp(o$par[3]), logLik = -o$value,
       threshold_ci = 100 * ends(1, 3), tilt_ci = 100 * ends(2, 6), spread_ci = 100 * exp(ends(3, 2)))
}

yes <- make("yes_no.csv", 320, 180, 70, 0, 0, 15)
two <- make("two_interval.csv", 350, -120, 90, 0.5, 0.02, 40)
z <- yes$asymmetry - 0.5
g <- glm(seen ~ duration + z, binomial("probit"), data.frame(yes, z), control = list(epsilon = 1e-14))
k <- coef(g); v <- vcov(g)
se <- function(grad) sqrt(as.numeric(t(grad) %*% v %*% grad))
counts <- aggregate(cbind(k = seen, n = 1) ~ duration + asymmetry, yes, sum)
h <- glm(cbind(k, n - k) ~ duration + asymmetry, binomial("probit"), counts, control = list(epsilon = 1e-14))
write(toJSON(list(R = R.version.string,
  glm = list(threshold = unname(-k[1] / k[2]), tilt = unname(-k[3] / k[2]), spread = unname(1 / k[2]),
             threshold_se = se(c(-1 / k[2], k[1] / k[2]^2, 0)), tilt_se = se(c(0, k[3] / k[2]^2, -1 / k[2])),
             logLik = as.numeric(logLik(g)), deviance = deviance(h), df = df.residual(h)),
  yes_no = fit(yes, 0, 0), two_interval = fit(two, 0.5, 0.02)), digits = 12, auto_unbox = TRUE),
  file.path(folder, "reference.json"))
