# Golden cumulative-link mixed models with one random intercept by adaptive Gauss-Hermite quadrature: ordinal::clmm, nAGQ.
# Run from this folder: Rscript quadrature.R. Writes quadrature.json. Data: models/ordinal_*.csv.
suppressPackageStartupMessages({library(ordinal); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
number <- function(x) unbox(as.numeric(x))
run <- function(name, nodes) {
  d <- read.csv(file.path("models", paste0(name, ".csv")), stringsAsFactors = TRUE)
  d$participant <- factor(d$participant); d$score <- factor(d$rating, ordered = TRUE)
  formula <- if (is.null(d$B)) score ~ A + (1 | participant) else score ~ A * B + (1 | participant)
  fit <- clmm(formula, d, link = "logit", nAGQ = nodes, Hess = TRUE,
    control = clmm.control(gradTol = 1e-8, grtol = 1e-8))
  cat(name, nodes, as.numeric(logLik(fit)), "\n")
  errors <- sqrt(diag(vcov(fit)))
  list(name = unbox(name), nodes = unbox(nodes), log_likelihood = number(logLik(fit)), thresholds = as.numeric(fit$alpha),
    coefficients = as.numeric(fit$beta), standard_errors = as.numeric(errors[names(fit$beta)]),
    sd_participant = number(fit$ST[[1]]))
}
fits <- list(run("ordinal_small", 10), run("ordinal_small", 25), run("ordinal_three_levels", 10), run("ordinal_rare_categories", 10),
  run("ordinal_far_apart", 2), run("ordinal_far_apart", 3), run("ordinal_far_apart", 5))
result <- list(provenance = list(R = unbox(R.version.string), ordinal = unbox(as.character(packageVersion("ordinal"))),
  command = unbox("Rscript quadrature.R"), date = unbox(format(Sys.Date()))), fits = fits)
writeLines(toJSON(result, digits = I(15), pretty = TRUE), "quadrature.json")
