# Golden mixed models: lmerTest (REML, Satterthwaite) and ordinal::clmm (Laplace) on models/*.csv.
# Run from this folder: Rscript models.R [case ...]. Writes models/<case>.json, a list of fits.
suppressPackageStartupMessages({
  library(lme4); library(lmerTest); library(ordinal); library(jsonlite)
})
options(contrasts = c("contr.sum", "contr.poly"))
tight <- lmerControl(optimizer = "nloptwrap", calc.derivs = FALSE, check.conv.singular = "ignore",
  optCtrl = list(algorithm = "NLOPT_LN_BOBYQA", xtol_abs = 1e-12, ftol_abs = 1e-12, maxeval = 1e5))

number <- function(x) if (length(x) == 0 || !is.finite(x)) NULL else unbox(as.numeric(x))
named <- function(x) lapply(as.list(x), number)

# Two-level factors as +1/-1 columns, so that `||` really gives uncorrelated slopes.
with_columns <- function(data, factors) {
  for (f in factors) data[[paste0("x", f)]] <- if (nlevels(data[[f]]) == 2) 3 - 2 * as.integer(data[[f]]) else NA
  data
}

fixed_part <- function(factors) paste("rating ~", paste(factors, collapse = " * "))
columns <- function(factors, operator) paste(paste0("x", factors), collapse = operator)

random_part <- function(factors, kind, data) {
  two <- all(sapply(factors, function(f) nlevels(data[[f]]) == 2))
  nested <- function(sets) paste(c("(1 | participant)", sprintf("(1 | participant:%s)", sets)), collapse = " + ")
  all_sets <- unlist(lapply(seq_along(factors), function(k) combn(factors, k, paste, collapse = ":")))
  switch(kind,
    none = "(1 | participant)",
    main = if (two) sprintf("(1 + %s || participant)", columns(factors, " + ")) else nested(factors),
    all = if (two) sprintf("(1 + %s || participant)", columns(factors, " * ")) else nested(all_sets),
    correlated = sprintf("(1 + %s | participant)", paste(factors, collapse = " + ")))
}

# BOBYQA stops where the criterion is flat to 1e-9, too early for four digits of the df: Newton steps go on from
# there, on the theta that are not at their bound.
fit_lmer <- function(formula, data) {
  parts <- lFormula(formula, data, REML = TRUE, control = tight)
  devfun <- do.call(mkLmerDevfun, parts)
  opt <- optimizeLmer(devfun, optimizer = "nloptwrap", control = tight$optCtrl)
  theta <- opt$par
  at_zero <- replace(theta, abs(theta) < 1e-3, 0)
  if (devfun(at_zero) <= devfun(theta) + 1e-6) theta <- at_zero
  free <- which(theta != 0)
  partial <- function(x) { full <- theta; full[free] <- x; devfun(full) }
  for (again in 1:4) {
    step <- solve(numDeriv::hessian(partial, theta[free]), numDeriv::grad(partial, theta[free]))
    if (partial(theta[free] - step) > partial(theta[free]) + 1e-9) break
    theta[free] <- theta[free] - step
  }
  at_end <- lmerControl(optimizer = NULL, calc.derivs = FALSE, check.conv.singular = "ignore")
  lmerTest::lmer(formula, data, REML = TRUE, start = theta, control = at_end)
}

mixed_fit <- function(data, factors, kind) {
  formula <- as.formula(paste(fixed_part(factors), "+", random_part(factors, kind, data), "+ (1 | clip)"))
  seconds <- system.time(fit <- fit_lmer(formula, data))[["elapsed"]]
  table <- anova(fit, type = 3, ddf = "Satterthwaite")
  list(model = unbox("mixed"), slopes = unbox(kind), formula = unbox(deparse1(formula)),
    reml_criterion = number(REMLcrit(fit)), singular = unbox(isSingular(fit, tol = 1e-4)), sigma = number(sigma(fit)),
    theta = getME(fit, "theta"), coefficients = named(fixef(fit)), seconds = number(seconds),
    effects = lapply(rownames(table), function(e) list(effect = unbox(e), f_value = number(table[e, "F value"]),
      df_effect = number(table[e, "NumDF"]), df_error = number(table[e, "DenDF"]), p_value = number(table[e, "Pr(>F)"]))))
}

ordinal_fit <- function(data, factors) {
  data$rating <- factor(data$rating, ordered = TRUE)
  formula <- as.formula(paste(fixed_part(factors), "+ (1 | participant) + (1 | clip)"))
  seconds <- system.time(fit <- clmm(formula, data, link = "logit", Hess = TRUE))[["elapsed"]]
  list(model = unbox("ordinal"), formula = unbox(deparse1(formula)), log_likelihood = number(logLik(fit)),
    thresholds = as.numeric(fit$alpha), categories = levels(data$rating), coefficients = named(fit$beta),
    standard_errors = named(sqrt(diag(vcov(fit)))[names(fit$beta)]),
    standard_deviations = lapply(VarCorr(fit), function(v) number(attr(v, "stddev"))), seconds = number(seconds))
}

plans <- list(
  mixed_two_by_two = c("none", "main", "all", "correlated"), mixed_three_levels = c("main", "all", "correlated"),
  mixed_unbalanced = c("main", "correlated", "ordinal"), mixed_no_slopes = c("none", "main", "all"),
  mixed_exp1 = c("none", "main", "all", "ordinal"), ordinal_small = "ordinal", ordinal_three_levels = "ordinal",
  ordinal_rare_categories = "ordinal")

run_case <- function(name) {
  data <- read.csv(file.path("models", paste0(name, ".csv")), stringsAsFactors = TRUE)
  factors <- setdiff(names(data), c("participant", "clip", "rating"))
  data <- with_columns(data, factors)
  fits <- lapply(plans[[name]], function(kind) {
    fit <- if (kind == "ordinal") ordinal_fit(data, factors) else mixed_fit(data, factors, kind)
    cat(name, kind, fit$seconds, "s\n")
    fit
  })
  versions <- lapply(c(lme4 = "lme4", lmerTest = "lmerTest", ordinal = "ordinal"), function(p) unbox(as.character(packageVersion(p))))
  provenance <- c(list(R = unbox(R.version.string)), versions,
    list(command = unbox(paste("Rscript models.R", name)), date = unbox(format(Sys.Date()))))
  writeLines(toJSON(list(provenance = provenance, factors = factors, fits = fits), digits = I(15), null = "null"),
    file.path("models", paste0(name, ".json")))
}

wanted <- commandArgs(trailingOnly = TRUE)
if (length(wanted) == 0) wanted <- names(plans)
for (name in wanted) run_case(name)
