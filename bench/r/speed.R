# Times R's own calls on data that R's packages ship, in the folder given: data as CSV, times.json of CPU seconds.
suppressPackageStartupMessages({library(lme4); library(lmerTest); library(ordinal); library(afex); library(jsonlite)})
folder <- commandArgs(TRUE)[1]
options(contrasts = c("contr.sum", "contr.poly"))
cpu <- function(expression) { s <- system.time(value <- force(expression)); list(cpu = s[[1]] + s[[2]], value = value) }
data(InstEval, package = "lme4"); data(fhch2010, package = "afex"); data(ks2013.3, package = "afex")
data(obk.long, package = "afex")
save <- function(d, name) write.csv(d, file.path(folder, paste0(name, ".csv")), row.names = FALSE)
save(InstEval, "insteval"); save(fhch2010, "fhch"); save(ks2013.3, "ks"); save(obk.long, "obk")
set.seed(1)
factorial <- expand.grid(id = 1:32, a = 1:2, b = 1:2, c = 1:2, d = 1:2, trial = 1:20)
factorial$rating <- sample(1:7, nrow(factorial), TRUE)
save(factorial, "factorial")
timed <- function(f) { r <- cpu(f()); c(list(cpu = r$cpu), r$value) }
# the least of as many calls as ours, warm like ours
least <- function(f) { f(); every <- sapply(1:50, function(i) cpu(f())$cpu); c(list(cpu = min(every)), f()) }
lmm <- function(formula, data) function() list(value = REMLcrit(lme4::lmer(formula, data)))
times <- list(
  ks = timed(lmm(response ~ validity * believability + (1 | id) + (1 | id:validity) + (1 | id:believability) +
    (1 | content), ks2013.3)),
  fhch = timed(lmm(log_rt ~ stimulus * density * frequency + (1 | id) + (1 | id:stimulus) + (1 | id:density) +
    (1 | id:frequency) + (1 | item), fhch2010)),
  insteval = timed(lmm(y ~ service + (1 | s) + (1 | d), InstEval)),
  clmm = timed(function() list(value = c(logLik(clmm(factor(response) ~ validity * believability + (1 | id) +
    (1 | content), ks2013.3))))),
  factorial = least(function() { suppressMessages(suppressWarnings(
    aov_ez("id", "rating", factorial, within = c("a", "b", "c", "d"), fun_aggregate = mean))); list(value = 0) }),
  anova = least(function() { suppressMessages(suppressWarnings(
    aov_ez("id", "value", obk.long, between = c("treatment", "gender"), within = c("phase", "hour"), observed = "gender")))
    list(value = 0) }))
write_json(times, file.path(folder, "times.json"), auto_unbox = TRUE, digits = 12)
