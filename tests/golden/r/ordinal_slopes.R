# Golden ordinal model with by-participant slopes: writes ordinal_slopes.csv and ordinal_slopes.json beside this file.
# Run from this folder: Rscript ordinal_slopes.R. R's ordinal::clmm, Laplace; slopes of +1/-1 columns as terms of their own.
suppressPackageStartupMessages({ library(ordinal); library(jsonlite) })
options(contrasts = c("contr.sum", "contr.poly"))
set.seed(5)
people <- sprintf("p%02d", 1:18)
clips <- expand.grid(k = 1:4, B = c("b1", "b2"), A = c("a1", "a2"))
clips$clip <- with(clips, paste0(A, B, "_", k))
data <- merge(data.frame(participant = people), clips)
x <- function(level, first) ifelse(level == first, 1, -1)
who <- match(data$participant, people); what <- match(data$clip, clips$clip)
own <- cbind(rnorm(18, 0, 1.1), rnorm(18, 0, 0.9), rnorm(18, 0, 0.6))
eta <- 0.7 * x(data$A, "a1") + 0.2 * x(data$B, "b1") + own[who, 1] + own[who, 2] * x(data$A, "a1") +
  own[who, 3] * x(data$B, "b1") + rnorm(16, 0, 0.9)[what] + rlogis(nrow(data))
data$rating <- as.integer(cut(eta, c(-Inf, -2, -0.7, 0.7, 2, Inf)))
data <- data[order(data$participant, data$clip), c("participant", "clip", "A", "B", "rating")]
write.csv(data, "ordinal_slopes.csv", row.names = FALSE, quote = FALSE)
d <- read.csv("ordinal_slopes.csv", stringsAsFactors = TRUE)
d$xA <- x(d$A, "a1"); d$xB <- x(d$B, "b1"); d$y <- factor(d$rating)
fit <- clmm(y ~ A * B + (1 | participant) + (0 + xA | participant) + (0 + xB | participant) + (1 | clip), d,
  Hess = TRUE, control = clmm.control(gradTol = 1e-7))
s <- summary(fit)
sds <- sapply(VarCorr(fit), function(v) attr(v, "stddev"))
write(toJSON(list(R = R.version.string, ordinal = as.character(packageVersion("ordinal")), log_likelihood = as.numeric(logLik(fit)),
  thresholds = unname(fit$alpha), coefficients = as.list(fit$beta), se = as.list(s$coefficients[names(fit$beta), "Std. Error"]),
  sds = as.list(setNames(unname(sds), sapply(seq_along(VarCorr(fit)), function(i) paste(names(VarCorr(fit))[i], rownames(VarCorr(fit)[[i]])))))), digits = 12, auto_unbox = TRUE, pretty = TRUE), "ordinal_slopes.json")
