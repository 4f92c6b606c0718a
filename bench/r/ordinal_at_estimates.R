# Whether an ordinal model's estimates are where clmm's likelihood has its maximum, for data on which clmm's own search takes long:
#
#   analysis ordinal FILE.csv --participant id --rating r --within mode,btype --between Gender --covariate Anger --item item --json OURS.json
#   Rscript ordinal_at_estimates.R FILE.csv OURS.json id r item Anger
#
# Prints both log-likelihoods at these estimates, clmm's largest derivative there, how far a Newton step moves any number (relative),
# what it gains, and how far standard errors are apart (relative). Needs ordinal and jsonlite; models of random intercepts.
suppressPackageStartupMessages({ library(ordinal); library(jsonlite) })
asked <- commandArgs(TRUE)
id <- asked[3]; rating <- asked[4]; item <- asked[5]; covariates <- asked[-(1:5)]
ours <- fromJSON(asked[2])
data <- read.csv(asked[1])
options(contrasts = c("contr.sum", "contr.poly"))
for (name in c(id, item, ours$factors)) data[[name]] <- factor(as.character(data[[name]]))
for (name in covariates) data[[name]] <- data[[name]] - mean(tapply(data[[name]], data[[id]], mean))
data$category <- factor(data[[rating]], ordered = TRUE)
fixed <- paste(c(paste(ours$factors, collapse = " * "), covariates), collapse = " + ")
likelihood <- clmm(as.formula(sprintf("category ~ %s + (1 | %s) + (1 | %s)", fixed, id, item)), data, doFit = FALSE,
  control = clmm.control(useMatrix = TRUE, gradTol = 1e-6))
# Ours, Gender[F]:mode[do], in R's words, Gender1:mode1, whose order is another.
in_r <- ours$coefficients$name
for (name in ours$factors) for (k in seq_len(nlevels(data[[name]])))
  in_r <- sub(sprintf("%s[%s]", name, levels(data[[name]])[k]), paste0(name, k), in_r, fixed = TRUE)
own <- match(colnames(model.matrix(as.formula(paste("~", fixed)), data))[-1], in_r)
spreads <- setNames(ours$components$sd, ours$components$group)[names(likelihood$dims$nlev.re)]
at <- c(ours$thresholds, ours$coefficients$estimate[own], spreads)
stopifnot(!anyNA(at))
minus_log <- function(x) getFromNamespace("getNLA", "ordinal")(likelihood, x)
slope <- getFromNamespace("deriv12", "ordinal")(minus_log, at)
step <- solve(slope$Hessian, slope$gradient)
se <- sqrt(diag(solve(slope$Hessian)))[length(ours$thresholds) + seq_along(own)]
cat(sprintf("log-likelihood %.10f, clmm's %.10f; largest derivative %.1e; a Newton step moves by %.1e and gains %.1e; standard errors %.1e apart\n",
  ours$log_likelihood, -minus_log(at), max(abs(slope$gradient)), max(abs(step / at)), sum(step * slope$gradient) / 2,
  max(abs(se / ours$coefficients$se[own] - 1))))
