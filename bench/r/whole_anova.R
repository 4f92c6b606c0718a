# The tables that `analysis anova` prints, as a whole program: Rscript whole_anova.R FILE.csv
# FILE has the columns id, face, speed and score.
suppressPackageStartupMessages({ library(afex); library(emmeans); library(effectsize) })
rows <- read.csv(commandArgs(TRUE)[1], colClasses = c(id = "factor", face = "factor", speed = "factor"))
fit <- aov_ez("id", "score", rows, within = c("face", "speed"), fun_aggregate = mean)
print(summary(fit$Anova, multivariate = TRUE, univariate = TRUE))
print(anova(fit, es = "ges"))
print(eta_squared(fit, partial = TRUE))
print(omega_squared(fit, partial = TRUE))
for (factor in c("face", "speed")) {
  means <- emmeans(fit, factor, model = "multivariate")
  print(means)
  print(pairs(means, adjust = "bonferroni", infer = TRUE))
}
print(emmeans(fit, c("face", "speed"), model = "multivariate"))
