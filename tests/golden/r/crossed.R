# Golden mixed models with a between factor, a covariate, crossed faces and clips, rooms nested in laboratories:
# lmerTest (REML, Satterthwaite). Run from this folder: Rscript crossed.R. Writes crossed.csv and crossed.json.
suppressPackageStartupMessages({library(lme4); library(lmerTest); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
set.seed(20)
people <- data.frame(participant = sprintf("p%02d", 1:30), group = rep(c("novice", "expert"), 15),
  age = round(runif(30, 18, 60)), lab = rep(c("north", "south", "west"), each = 10), room = rep(1:2, each = 5))
clips <- data.frame(clip = sprintf("c%02d", 1:16), face = rep(c("anna", "ben", "cleo", "dan"), each = 4))
d <- merge(merge(people, clips), data.frame(blur = c("none", "some", "much")))
d <- d[runif(nrow(d)) < 0.6, ]
draw <- function(x, sd) { u <- rnorm(nlevels(factor(x)), 0, sd); u[as.integer(factor(x))] }
d$rating <- round(4 + 0.3 * (d$group == "expert") + 0.02 * (d$age - 40) + 0.4 * (d$blur == "much") +
  draw(d$participant, .6) + draw(paste(d$participant, d$blur), .4) + draw(d$clip, .4) + draw(d$face, .5) +
  draw(d$lab, .4) + draw(paste(d$lab, d$room), .5) + rnorm(nrow(d)), 3)
d <- d[order(d$participant, d$clip, d$blur), c("participant", "group", "age", "lab", "room", "clip", "face", "blur", "rating")]
write.csv(d, "crossed.csv", row.names = FALSE, quote = FALSE)
# levels as ours: numbers and texts in natural order
for (f in c("group", "blur", "participant", "clip", "face", "lab", "room")) d[[f]] <- factor(d[[f]])
d$age <- d$age - mean(people$age[people$participant %in% d$participant])
tight <- lmerControl(optimizer = "nloptwrap", calc.derivs = FALSE, check.conv.singular = "ignore",
  optCtrl = list(algorithm = "NLOPT_LN_BOBYQA", xtol_abs = 1e-12, ftol_abs = 1e-12, maxeval = 1e5))
fit <- lmer(rating ~ group * blur + age + (1 | participant) + (1 | participant:blur) + (1 | clip) + (1 | face) +
  (1 | lab) + (1 | lab:room), d, control = tight)
tests <- anova(fit, type = 3)
sds <- as.data.frame(VarCorr(fit))
table <- coef(summary(fit))
write_json(list(
  effects = data.frame(effect = rownames(tests), f_value = tests$`F value`, df_effect = tests$NumDF,
    df_error = tests$DenDF, p_value = tests$`Pr(>F)`),
  coefficients = data.frame(name = rownames(table), estimate = table[, 1], se = table[, 2], df = table[, 3]),
  sds = setNames(as.list(sds$sdcor), sds$grp), reml_criterion = REMLcrit(fit),
  provenance = list(R = R.version.string, lme4 = as.character(packageVersion("lme4")),
    lmerTest = as.character(packageVersion("lmerTest")), command = "Rscript crossed.R", date = format(Sys.Date()))),
  "crossed.json", auto_unbox = TRUE, digits = 15, pretty = TRUE)
