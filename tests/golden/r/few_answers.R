# Few answers of people who differ much, where Laplace's approximation is far off: glmer with 50 nodes.
# Rscript few_answers.R, in this folder; writes few_answers.csv and few_answers.json.
suppressPackageStartupMessages({library(lme4); library(jsonlite)})
set.seed(11)
d <- expand.grid(time = 0:4, participant = sprintf("p%03d", 1:150))
d$group <- ifelse(as.integer(d$participant) %% 2 == 1, "a", "b")
level <- rnorm(150, 0, 4)[as.integer(d$participant)]
d$answer <- as.integer(-1 + level - 0.5 * d$time + 0.8 * (d$group == "a") + rlogis(nrow(d)) > 0)
write.csv(d[, c("participant", "group", "time", "answer")], "few_answers.csv", row.names = FALSE, quote = FALSE)
d$group <- factor(d$group); contrasts(d$group) <- contr.sum(2); d$time <- d$time - mean(d$time)
of <- function(nodes) {
  f <- glmer(answer ~ group + time + (1 | participant), d, family = binomial, nAGQ = nodes,
    control = glmerControl(optimizer = "bobyqa", optCtrl = list(maxfun = 1e5, rhoend = 1e-9)))
  s <- coef(summary(f))
  list(estimates = unname(s[2:3, 1]), se = unname(s[2:3, 2]), sd = attr(VarCorr(f)$participant, "stddev")[[1]])
}
write_json(list(quadrature = of(50), laplace = of(1)), "few_answers.json", digits = 10, auto_unbox = TRUE, pretty = TRUE)
