# Slopes of participants and of clips in an ordinal model. Rscript item_slopes.R, in this folder; writes
# item_slopes.csv and item_slopes.json. clmm has no ||: the slopes of the column +1/-1 are terms of their own.
suppressPackageStartupMessages({library(ordinal); library(jsonlite)})
set.seed(54)
d <- expand.grid(a = c("p", "q"), participant = sprintf("p%02d", 1:24), clip = sprintf("c%02d", 1:16))
sign <- ifelse(d$a == "p", 1, -1)
who <- as.integer(d$participant); what <- as.integer(d$clip)
person <- matrix(rnorm(48), 24) %*% diag(c(1.2, .5)); item <- matrix(rnorm(32), 16) %*% diag(c(1.0, .7))
latent <- .4 * sign + person[who, 1] + person[who, 2] * sign + item[what, 1] + item[what, 2] * sign + rlogis(nrow(d))
d$rating <- cut(latent, c(-Inf, -1.5, -.4, .5, 1.6, Inf), labels = FALSE)
write.csv(d, "item_slopes.csv", row.names = FALSE, quote = FALSE)
d$x <- sign; d$rating <- factor(d$rating)
fit <- clmm(rating ~ x + (1 | participant) + (0 + x | participant) + (1 | clip) + (0 + x | clip), d,
  control = clmm.control(gradTol = 1e-7))
s <- coef(summary(fit))["x", ]
write_json(list(
  provenance = list(R = R.version.string, ordinal = as.character(packageVersion("ordinal")),
    command = "Rscript item_slopes.R", date = format(Sys.Date())),
  log_likelihood = c(logLik(fit)), thresholds = unname(fit$alpha), estimate = s[[1]], se = s[[2]],
  sds = as.list(setNames(sapply(VarCorr(fit), function(m) sqrt(m[1, 1])),
    paste(names(VarCorr(fit)), sapply(VarCorr(fit), rownames))))), "item_slopes.json", digits = 10, auto_unbox = TRUE, pretty = TRUE)
