# Golden: a threshold for each person and one spread, by lme4's adaptive quadrature. Rscript population.R.
suppressPackageStartupMessages({library(lme4); library(jsonlite)})
d <- read.csv("population.csv")
m <- glmer(y ~ x + (1 | id), d, binomial("probit"), nAGQ = 25, control = glmerControl(optimizer = "bobyqa"))
b <- fixef(m)
sd <- unname(sqrt(unlist(VarCorr(m))))
write_json(list(threshold = -b[[1]] / b[[2]], threshold_sd = sd / b[[2]], spread = 1 / b[[2]],
  log_likelihood = as.numeric(logLik(m)), provenance = list(R = R.version.string,
  lme4 = as.character(packageVersion("lme4")), command = "Rscript population.R")), "population.json",
  auto_unbox = TRUE, digits = 15)
