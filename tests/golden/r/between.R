# Golden results of within x between x covariate designs: for every between/*.csv and type writes between/<name>_<type>.json.
# Run from this folder: Rscript between.R. Cases are those of between_data.R, which runs first and writes the CSV files.
suppressPackageStartupMessages({
  library(afex); library(car); library(emmeans); library(jsonlite)
})
afex_options(emmeans_model = "multivariate")
emm_options(msg.interaction = FALSE, msg.nesting = FALSE)
source("between_data.R")

number <- function(x) if (length(x) == 0 || !is.finite(x)) NULL else unbox(as.numeric(x))

four <- function(anova, effect) {
  h <- as.matrix(anova$SSP[[effect]]); e <- as.matrix(anova$SSPE[[effect]])
  r <- anova$df[[effect]]; nu <- anova$error.df
  if (ncol(e) > nu || qr(e)$rank < ncol(e)) return(NULL)
  values <- Re(eigen(qr.coef(qr(e), h), symmetric = FALSE, only.values = TRUE)$values)
  one <- function(f) {
    s <- f(values, r, nu)
    list(value = number(s[1]), f_value = number(s[2]), df_effect = number(s[3]), df_error = number(s[4]),
      p_value = number(pf(s[2], s[3], s[4], lower.tail = FALSE)))
  }
  list(pillai = one(stats:::Pillai), wilks = one(stats:::Wilks), hotelling_lawley = one(stats:::HL), roy = one(stats:::Roy))
}

with_within <- function(aov, effect) {
  s <- suppressWarnings(summary(aov$Anova, multivariate = FALSE))
  u <- s$univariate.tests; eps <- s$pval.adjustments; m <- s$sphericity.tests
  f <- u[effect, "F value"]; d1 <- u[effect, "num Df"]; d2 <- u[effect, "den Df"]
  has <- !is.null(eps) && effect %in% rownames(eps)
  gg <- if (has) eps[effect, "GG eps"] else 1
  hf <- if (has) eps[effect, "HF eps"] else 1
  p <- function(k) pf(f, d1 * k, d2 * k, lower.tail = FALSE)
  list(univariate = list(ss = number(u[effect, "Sum Sq"]), ss_error = number(u[effect, "Error SS"]), df_effect = number(d1),
      df_error = number(d2), f_value = number(f), p_value = number(u[effect, "Pr(>F)"]), epsilon_gg = number(gg),
      p_gg = number(p(gg)), epsilon_hf = number(hf), p_hf = number(p(min(1, hf)))),
    multivariate = four(aov$Anova, effect),
    mauchly_w = if (!is.null(m) && effect %in% rownames(m)) number(m[effect, "Test statistic"]))
}

without_within <- function(aov, effect) {
  t <- aov$Anova
  f <- t[effect, "F value"]
  list(univariate = list(ss = number(t[effect, "Sum Sq"]), ss_error = number(t["Residuals", "Sum Sq"]),
    df_effect = number(t[effect, "Df"]), df_error = number(t["Residuals", "Df"]), f_value = number(f),
    p_value = number(t[effect, "Pr(>F)"])))
}

means_of <- function(aov, set) {
  table <- as.data.frame(summary(emmeans(aov, set), infer = c(TRUE, FALSE)))
  lapply(seq_len(nrow(table)), function(i) list(
    levels = lapply(as.list(table[i, set, drop = FALSE]), function(v) unbox(sub("^X(?=[0-9])", "", as.character(v), perl = TRUE))),
    mean = number(table$emmean[i]), se = number(table$SE[i]), df = number(table$df[i])))
}

pairs_of <- function(aov, set) {
  grid <- emmeans(aov, set)
  labels <- apply(sapply(as.data.frame(grid@grid[set]), as.character), 1, paste, collapse = ":")
  if (length(set) == 1) labels <- as.character(grid@grid[[set]])
  labels <- gsub("(^|:)X(?=[0-9])", "\\1", labels, perl = TRUE)
  t <- as.data.frame(summary(pairs(grid, adjust = "none"), infer = c(TRUE, TRUE)))
  tukey <- as.data.frame(summary(pairs(grid, adjust = "tukey")))
  sidak <- as.data.frame(summary(pairs(grid, adjust = "sidak")))
  fdr <- as.data.frame(summary(pairs(grid, adjust = "fdr")))
  which <- combn(length(labels), 2)
  lapply(seq_len(nrow(t)), function(i) list(level_a = unbox(labels[which[1, i]]), level_b = unbox(labels[which[2, i]]),
    difference = number(t$estimate[i]), se = number(t$SE[i]), t = number(t$t.ratio[i]), df = number(t$df[i]),
    p = number(t$p.value[i]), p_tukey = number(tukey$p.value[i]), p_sidak = number(sidak$p.value[i]),
    p_fdr = number(fdr$p.value[i])))
}

simple_of <- function(aov, of, at) {
  t <- as.data.frame(joint_tests(aov, by = at))
  t <- t[t[["model term"]] == of, , drop = FALSE]
  lapply(seq_len(nrow(t)), function(i) list(of = unbox(of), at = unbox(sub("^X(?=[0-9])", "", as.character(t[[at]][i]), perl = TRUE)),
    f_value = number(t$F.ratio[i]), df_effect = number(t$df1[i]), df_error = number(t$df2[i]), p_value = number(t$p.value[i])))
}

run_case <- function(name, case, type) {
  data <- read.csv(file.path("between", paste0(name, ".csv")), colClasses = "character")
  data$y <- as.numeric(data$y)
  for (f in c("id", case$within, case$between)) data[[f]] <- factor(data[[f]])
  for (x in case$covariate) {
    data[[x]] <- as.numeric(data[[x]])
    data[[x]] <- data[[x]] - mean(tapply(data[[x]], data$id, mean))
  }
  aov <- suppressWarnings(suppressMessages(aov_ez("id", "y", data, within = case$within, between = case$between,
    covariate = case$covariate, type = type, factorize = FALSE, fun_aggregate = mean, include_aov = FALSE)))
  sizes <- anova(aov, es = c("ges", "pes"), correction = "none")
  effects <- lapply(rownames(sizes), function(e) c(list(effect = unbox(e)),
    if (is.null(case$within)) without_within(aov, e) else with_within(aov, e),
    list(eta_sq_partial = number(sizes[e, "pes"]), eta_sq_generalized = number(sizes[e, "ges"]))))
  factors <- c(case$between, case$within)
  sets <- c(as.list(factors), if (length(factors) > 1) combn(factors, 2, simplify = FALSE))
  result <- list(provenance = list(R = unbox(R.version.string), afex = unbox(as.character(packageVersion("afex"))),
      car = unbox(as.character(packageVersion("car"))), emmeans = unbox(as.character(packageVersion("emmeans"))),
      command = unbox("Rscript between.R"), date = unbox(format(Sys.Date()))),
    file = unbox(paste0(name, ".csv")), within = case$within, between = case$between, covariates = case$covariate,
    type = unbox(type), effects = effects,
    marginal_means = lapply(sets, function(s) list(factors = s, means = means_of(aov, s))),
    pairwise = lapply(sets, function(s) list(factors = s, pairs = pairs_of(aov, s))),
    simple = if (length(factors) > 1 && !is.null(case$within))
      simple_of(aov, case$within[[1]], setdiff(factors, case$within[[1]])[[1]]))
  writeLines(toJSON(result, digits = I(17), null = "null"), file.path("between", sprintf("%s_%d.json", name, type)))
}

for (name in names(cases)) for (type in c(2, 3)) run_case(name, cases[[name]], type)
