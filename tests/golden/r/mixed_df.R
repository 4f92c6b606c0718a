# Golden Kenward-Roger tests (lmerTest by pbkrtest) and profile intervals (lme4) of models on models/*.csv and crossed.csv.
# Run from this folder: Rscript mixed_df.R. Writes mixed_df.json, a list of fits.
suppressPackageStartupMessages({library(lme4); library(lmerTest); library(pbkrtest); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
tight <- lmerControl(optimizer = "nloptwrap", calc.derivs = FALSE, check.conv.singular = "ignore",
  optCtrl = list(algorithm = "NLOPT_LN_BOBYQA", xtol_abs = 1e-12, ftol_abs = 1e-12, maxeval = 1e5))

# BOBYQA stops where the criterion is flat to 1e-9, too early for four digits of the df: Newton steps go on from there.
fit_lmer <- function(formula, data) {
  devfun <- do.call(mkLmerDevfun, lFormula(formula, data, REML = TRUE, control = tight))
  theta <- optimizeLmer(devfun, optimizer = "nloptwrap", control = tight$optCtrl)$par
  at_zero <- replace(theta, abs(theta) < 1e-3, 0)
  if (devfun(at_zero) <= devfun(theta) + 1e-6) theta <- at_zero
  free <- which(theta != 0)
  partial <- function(x) { full <- theta; full[free] <- x; devfun(full) }
  for (again in 1:4) {
    step <- solve(numDeriv::hessian(partial, theta[free]), numDeriv::grad(partial, theta[free]))
    if (partial(theta[free] - step) > partial(theta[free]) + 1e-9) break
    theta[free] <- theta[free] - step
  }
  lmerTest::lmer(formula, data, REML = TRUE, start = theta,
    control = lmerControl(optimizer = NULL, calc.derivs = FALSE, check.conv.singular = "ignore"))
}

two_levels <- function(data) {
  for (f in c("A", "B", "C")) if (!is.null(data[[f]]) && nlevels(data[[f]]) == 2) data[[paste0("x", f)]] <- 3 - 2 * as.integer(data[[f]])
  data
}

tests_of <- function(fit) {
  table <- anova(fit, type = 3, ddf = "Kenward-Roger")
  rows <- coef(summary(fit, ddf = "Kenward-Roger"))
  list(effects = lapply(rownames(table), function(e) list(effect = unbox(e), f_value = unbox(table[e, "F value"]),
      df_effect = unbox(table[e, "NumDF"]), df_error = unbox(table[e, "DenDF"]), p_value = unbox(table[e, "Pr(>F)"]))),
    coefficients = lapply(rownames(rows), function(n) list(name = unbox(n), estimate = unbox(rows[n, 1]),
      se = unbox(rows[n, 2]), df = unbox(rows[n, 3]), t = unbox(rows[n, 4]))))
}

# lme4 interpolates the profile; 40 points per side make its splines good to five digits
intervals_of <- function(formula, data) {
  fit <- lme4::lmer(formula, data, control = tight)
  profile <- profile(fit, signames = FALSE, maxpts = 200, delta = 0.1, delta.cutoff = 1 / 40)
  ci <- confint(profile, level = 0.95)
  lapply(rownames(ci), function(n) list(name = unbox(n), low = unbox(ci[n, 1]), high = unbox(ci[n, 2])))
}

read <- function(name) {
  d <- read.csv(name, stringsAsFactors = TRUE)
  d$participant <- factor(d$participant)
  if (!is.null(d$clip)) d$clip <- factor(d$clip)
  two_levels(d)
}

crossed <- read("crossed.csv")
for (f in c("face", "lab", "room")) crossed[[f]] <- factor(crossed[[f]])
people <- unique(crossed[c("participant", "age")])
crossed$age <- crossed$age - mean(people$age)

cases <- list(
  list(file = "models/mixed_two_by_two.csv", slopes = "main", formula = rating ~ A * B + (1 + xA + xB || participant) + (1 | clip), profile = TRUE),
  list(file = "models/mixed_two_by_two.csv", slopes = "correlated", formula = rating ~ A * B + (1 + A + B | participant) + (1 | clip), profile = FALSE),
  list(file = "models/mixed_three_levels.csv", slopes = "all",
    formula = rating ~ A * B + (1 | participant) + (1 | participant:A) + (1 | participant:B) + (1 | participant:A:B) + (1 | clip), profile = FALSE),
  list(file = "models/mixed_unbalanced.csv", slopes = "main", formula = NULL, profile = TRUE),
  list(file = "crossed.csv", slopes = "main", formula = rating ~ group * blur + age + (1 | participant) + (1 | participant:blur) +
    (1 | clip) + (1 | face) + (1 | lab) + (1 | lab:room), profile = FALSE))

run <- function(case) {
  data <- if (case$file == "crossed.csv") crossed else read(case$file)
  formula <- case$formula
  if (is.null(formula)) {
    golden <- fromJSON(sub("csv$", "json", case$file), simplifyVector = FALSE)
    formula <- as.formula(Filter(function(f) identical(f$slopes, case$slopes), golden$fits)[[1]]$formula)
  }
  cat(case$file, case$slopes, deparse1(formula), "\n")
  fit <- fit_lmer(formula, data)
  c(list(file = unbox(case$file), slopes = unbox(case$slopes), formula = unbox(deparse1(formula))), tests_of(fit),
    list(intervals = if (case$profile) intervals_of(formula, data)))
}

versions <- lapply(c(lme4 = "lme4", lmerTest = "lmerTest", pbkrtest = "pbkrtest"), function(p) unbox(as.character(packageVersion(p))))
result <- list(provenance = c(list(R = unbox(R.version.string)), versions, list(command = unbox("Rscript mixed_df.R"),
  date = unbox(format(Sys.Date())))), fits = lapply(cases, run))
writeLines(toJSON(result, digits = I(15), null = "null", pretty = TRUE), "mixed_df.json")
