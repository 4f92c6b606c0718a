# Means, pairs, trends and likelihood-ratio tests after mixed models, by emmeans and by leaving out columns.
# On crossed.csv and models/ordinal_three_levels.csv. Run here: Rscript means.R
suppressPackageStartupMessages({library(lme4); library(lmerTest); library(ordinal); library(emmeans); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
emm_options(lmer.df = "satterthwaite")
d <- read.csv("crossed.csv")
for (f in c("group", "blur", "participant", "clip")) d[[f]] <- factor(d[[f]])
people <- d[!duplicated(d$participant), ]
d$age <- d$age - mean(people$age)
tight <- lmerControl(optimizer = "nloptwrap", calc.derivs = FALSE, check.conv.singular = "ignore",
  optCtrl = list(algorithm = "NLOPT_LN_BOBYQA", xtol_abs = 1e-12, ftol_abs = 1e-12, maxeval = 1e5))
# BOBYQA stops where the criterion is flat to 1e-9: Newton steps go on from there, as in models.R.
polished <- function(formula, data) {
  devfun <- do.call(mkLmerDevfun, lFormula(formula, data, REML = TRUE, control = tight))
  theta <- getME(lmer(formula, data, control = tight), "theta"); free <- which(theta > 1e-3); theta[-free] <- 0
  partial <- function(x) { full <- theta; full[free] <- x; devfun(full) }
  for (again in 1:4) theta[free] <- theta[free] - solve(numDeriv::hessian(partial, theta[free]), numDeriv::grad(partial, theta[free]))
  lmerTest::lmer(formula, data, start = theta, control = lmerControl(optimizer = NULL, calc.derivs = FALSE, check.conv.singular = "ignore"))
}
random <- "(1 | participant) + (1 | participant:blur) + (1 | clip)"
fit <- polished(as.formula(paste("rating ~ group * blur + age + group:age +", random)), d)
rows <- function(s, keys) lapply(seq_len(nrow(s)), function(i) as.list(setNames(s[i, ], keys)))
frame <- function(grid, ...) as.data.frame(summary(grid, infer = c(TRUE, TRUE), ...))
means <- function(fit, margin, df) {
  e <- emmeans(fit, as.formula(paste("~", margin)), lmer.df = df, at = list(age = 0))
  s <- frame(e); p <- frame(pairs(e, adjust = "none"))
  list(margin = margin, estimate = s$emmean, se = s$SE, df = s$df, low = s[[ncol(s) - 3]], high = s[[ncol(s) - 2]],
    cells = do.call(paste, c(lapply(strsplit(margin, ":")[[1]], function(v) as.character(s[[v]])), sep = ":")),
    pair = as.character(p$contrast), difference = p$estimate, pair_se = p$SE, pair_df = p$df, p = p$p.value,
    bonferroni = frame(pairs(e, adjust = "bonferroni"))$p.value, holm = frame(pairs(e, adjust = "holm"))$p.value,
    tukey = frame(pairs(e, adjust = "tukey"))$p.value)
}
trends <- function(df) {
  t <- emtrends(fit, ~ group, var = "age", lmer.df = df); s <- frame(t); p <- frame(pairs(t, adjust = "none"))
  list(level = as.character(s$group), slope = s$age.trend, se = s$SE, df = s$df, low = s$lower.CL, high = s$upper.CL,
    difference = p$estimate, pair_se = p$SE, pair_df = p$df, p = p$p.value)
}
margins <- c("group", "blur", "group:blur")
x <- model.matrix(~ group * blur + age + group:age, d)
own <- attr(x, "assign"); names_of <- c("group", "blur", "age", "group:blur", "group:age")
likelihood <- function(keep) { z <- x[, keep, drop = FALSE]
  as.numeric(logLik(lmer(as.formula(paste("rating ~ 0 + z +", random)), d, REML = FALSE, control = tight))) }
full <- likelihood(rep(TRUE, ncol(x)))
lrt <- lapply(seq_along(names_of), function(k) { chi2 <- 2 * (full - likelihood(own != k)); df <- sum(own == k)
  list(effect = names_of[k], chi2 = chi2, df = df, p = pchisq(chi2, df, lower.tail = FALSE)) })
o <- read.csv("models/ordinal_three_levels.csv")
factors <- setdiff(names(o), c("participant", "clip", "rating"))
for (f in c(factors, "participant", "clip")) o[[f]] <- factor(o[[f]])
o$rating <- factor(o$rating, ordered = TRUE)
fixed <- paste(factors, collapse = " * ")
ofit <- clmm(as.formula(paste("rating ~", fixed, "+ (1 | participant) + (1 | clip)")), o, Hess = TRUE,
  control = clmm.control(grtol = 1e-8))
latent <- function(margin) {
  e <- emmeans(ofit, as.formula(paste("~", margin)), mode = "latent"); s <- frame(e); p <- frame(pairs(e, adjust = "none"))
  list(margin = margin, estimate = s$emmean, se = s$SE, low = s$asymp.LCL, high = s$asymp.UCL,
    pair = as.character(p$contrast), difference = p$estimate, pair_se = p$SE, p = p$p.value,
    holm = frame(pairs(e, adjust = "holm"))$p.value, tukey = frame(pairs(e, adjust = "tukey"))$p.value)
}
ox <- model.matrix(as.formula(paste("~", fixed)), o); oown <- attr(ox, "assign")
olabels <- attr(terms(as.formula(paste("~", fixed))), "term.labels")
ol <- function(keep) { z <- ox[, keep & oown > 0, drop = FALSE]
  as.numeric(logLik(if (ncol(z)) clmm(rating ~ z + (1 | participant) + (1 | clip), o, control = clmm.control(grtol = 1e-8))
    else clmm(rating ~ 1 + (1 | participant) + (1 | clip), o, control = clmm.control(grtol = 1e-8)))) }
ofull <- ol(rep(TRUE, ncol(ox)))
olrt <- lapply(seq_along(olabels), function(k) { chi2 <- 2 * (ofull - ol(oown != k)); df <- sum(oown == k)
  list(effect = olabels[k], chi2 = chi2, df = df, p = pchisq(chi2, df, lower.tail = FALSE)) })
write_json(list(
  provenance = list(R = R.version.string, lme4 = as.character(packageVersion("lme4")), lmerTest = as.character(packageVersion("lmerTest")),
    emmeans = as.character(packageVersion("emmeans")), ordinal = as.character(packageVersion("ordinal")), command = "Rscript means.R", date = format(Sys.Date())),
  satterthwaite = lapply(margins, function(m) means(fit, m, "satterthwaite")),
  kenward_roger = lapply(margins, function(m) means(fit, m, "kenward-roger")),
  trends = list(satterthwaite = trends("satterthwaite"), kenward_roger = trends("kenward-roger")),
  lrt = lrt, ordinal = lapply(factors, latent), ordinal_lrt = olrt, ordinal_factors = factors),
  "means.json", auto_unbox = TRUE, digits = 15, pretty = TRUE)
