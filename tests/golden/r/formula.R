# Models that are not full factorials, with correlated slopes, by lmerTest and clmm. Run here: Rscript formula.R
suppressPackageStartupMessages({library(lme4); library(lmerTest); library(ordinal); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
d <- read.csv("crossed.csv")
for (f in c("group", "blur", "participant", "clip", "lab", "room")) d[[f]] <- factor(d[[f]])
d$age <- d$age - mean(d[!duplicated(d$participant), "age"])
tight <- lmerControl(optimizer = "nloptwrap", calc.derivs = FALSE, check.conv.singular = "ignore",
  optCtrl = list(algorithm = "NLOPT_LN_BOBYQA", xtol_abs = 1e-12, ftol_abs = 1e-12, maxeval = 1e5))
fits <- lapply(c(
  "rating ~ group + blur + age + group:age + (1 + blur | participant) + (1 | clip)",
  "rating ~ blur + age + (1 | participant) + (1 | clip)",
  "rating ~ group + blur + age + (1 + blur | participant) + (1 + age || clip)",
  "rating ~ 1 + (1 | participant) + (1 | clip)"), function(text) {
    fit <- lmer(as.formula(text), d, control = tight)
    for (i in 1:9) fit <- update(fit, start = getME(fit, "theta") * (1 + 0.1 * (i %% 3))) # BOBYQA stops early
    tests <- if (grepl("blur", text)) { a <- anova(fit, type = 3)
      data.frame(effect = rownames(a), f = a$`F value`, df1 = a$NumDF, df2 = a$DenDF) } else list()
    clip_age <- with(as.data.frame(VarCorr(fit)), sdcor[grepl("^clip", grp) & var1 %in% "age"])
    list(formula = text, sd_clip_age = I(clip_age), reml = REMLcrit(fit), tests = tests, fixed = as.list(fixef(fit)), sigma = sigma(fit))
  })
o <- read.csv("models/ordinal_three_levels.csv")
for (f in c("A", "B", "participant", "clip")) o[[f]] <- factor(o[[f]])
o$rating <- factor(o$rating, ordered = TRUE)
additive <- clmm(rating ~ A + B + (1 | participant) + (1 | clip), o, control = clmm.control(grtol = 1e-8))
empty <- clmm(rating ~ 1 + (1 | participant) + (1 | clip), o, control = clmm.control(grtol = 1e-8))
write_json(list(provenance = list(R = R.version.string, lme4 = as.character(packageVersion("lme4")),
    ordinal = as.character(packageVersion("ordinal")), command = "Rscript formula.R", date = format(Sys.Date())),
  mixed = fits, ordinal = list(log_likelihood = as.numeric(logLik(additive)), beta = additive$beta,
    empty = as.numeric(logLik(empty)))), "formula.json", auto_unbox = TRUE, digits = 15, pretty = TRUE)
