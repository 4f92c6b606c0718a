# Covariates that vary within participants, and their interactions, by lmerTest and by ordinal.
# Rscript covariates.R, in this folder; writes covariates.csv and covariates.json.
suppressMessages({library(lme4); library(lmerTest); library(jsonlite)})
RNGversion("4.0.0"); set.seed(49)
rows <- do.call(rbind, lapply(1:20, function(p) {
  n <- sample(12:20, 1)
  data.frame(participant = sprintf("p%02d", p), group = c("a", "b")[1 + p %% 2], age = 20 + (p * 7) %% 31,
             cond = sample(c("x", "y"), n, TRUE), dose = round(rexp(n, 0.02) + 100, 1))
}))
slope <- setNames(rnorm(20, 0.02, 0.02), unique(rows$participant))
level <- setNames(rnorm(20, 0, 1), unique(rows$participant))
rows$rating <- round(5 + level[rows$participant] + (rows$dose - 100) * slope[rows$participant] +
  0.4 * (rows$cond == "y") + 0.005 * (rows$dose - 150) * (rows$cond == "y") + rnorm(nrow(rows)), 3)
write.csv(rows, "covariates.csv", row.names = FALSE, quote = FALSE)

d <- rows
d$group <- factor(d$group); contrasts(d$group) <- contr.sum(2)
d$cond <- factor(d$cond); contrasts(d$cond) <- contr.sum(2)
d$dose <- d$dose - mean(d$dose)
d$age <- d$age - mean(tapply(d$age, d$participant, `[`, 1))
d$c <- ifelse(d$cond == "x", 1, -1); d$cd <- d$c * d$dose
control <- lmerControl(optimizer = "bobyqa", optCtrl = list(maxfun = 1e5, rhoend = 1e-9))
effects_of <- function(f, ddf = "Satterthwaite") {
  a <- anova(f, ddf = ddf)
  data.frame(effect = rownames(a), f_value = a[["F value"]], df_effect = a$NumDF, df_error = a$DenDF)
}
sds_of <- function(f) { v <- as.data.frame(VarCorr(f)); v[, c("grp", "var1", "var2", "sdcor")] }
fit <- function(formula) {
  f <- lmer(formula, d, control = control)
  list(reml = REMLcrit(f), effects = effects_of(f), kr = effects_of(f, "Kenward-Roger"), sds = sds_of(f))
}
d$high <- as.integer(d$rating > 6.5)
d$ten <- d$dose / 10
g <- glmer(high ~ ten + (1 | participant) + (0 + ten | participant), d, family = binomial,
  control = glmerControl(optimizer = "bobyqa", optCtrl = list(maxfun = 1e5, rhoend = 1e-9)))
ordinal <- list(logLik = as.numeric(logLik(g)), estimate = fixef(g)[["ten"]] / 10,
  se = coef(summary(g))["ten", 2] / 10, sds = sds_of(g))
out <- list(
  ordinal = ordinal,
  plain = fit(rating ~ dose + (dose | participant)),
  main = fit(rating ~ group * cond + dose + (dose | participant) + (0 + c | participant)),
  products = fit(rating ~ group * cond + dose + age + group:dose + cond:dose + age:dose +
    (dose | participant) + (0 + c | participant) + (0 + cd | participant)),
  none = fit(rating ~ dose + (1 | participant)))
write_json(out, "covariates.json", digits = 10, auto_unbox = TRUE, pretty = TRUE)
