# Models of participants alone: lmerTest (REML, Satterthwaite) and ordinal::clmm (Laplace) on two files of models/.
# Run from this folder: Rscript without_item.R. Writes without_item.json.
suppressPackageStartupMessages({
  library(lme4); library(lmerTest); library(ordinal); library(jsonlite)
})
options(contrasts = c("contr.sum", "contr.poly"))
data <- read.csv("models/mixed_two_by_two.csv", stringsAsFactors = TRUE)
data$participant <- factor(data$participant)
tight <- lmerControl(calc.derivs = FALSE, optCtrl = list(xtol_abs = 1e-12, ftol_abs = 1e-12))
fit <- lmer(rating ~ A * B + (1 | participant), data, control = tight)
tests <- anova(fit, type = 3)
small <- read.csv("models/ordinal_small.csv", stringsAsFactors = TRUE)
small$score <- factor(small$rating)
ordered <- clmm(score ~ A * B + (1 | participant), small)
result <- list(
  provenance = list(R = unbox(R.version.string), lmerTest = unbox(as.character(packageVersion("lmerTest"))),
    ordinal = unbox(as.character(packageVersion("ordinal"))), command = unbox("Rscript without_item.R"),
    date = unbox(format(Sys.Date()))),
  mixed = list(reml = unbox(as.numeric(-2 * logLik(fit))), sigma = unbox(sigma(fit)),
    sd_participant = unbox(attr(VarCorr(fit)$participant, "stddev")[[1]]),
    effects = lapply(rownames(tests), function(e) list(effect = unbox(e), f_value = unbox(tests[e, "F value"]),
      df_effect = unbox(tests[e, "NumDF"]), df_error = unbox(tests[e, "DenDF"]), p_value = unbox(tests[e, "Pr(>F)"])))),
  ordinal = list(log_likelihood = unbox(as.numeric(logLik(ordered))), sd_participant = unbox(as.numeric(ordered$ST[[1]])),
    beta = as.numeric(ordered$beta)))
writeLines(toJSON(result, digits = I(17)), "without_item.json")
