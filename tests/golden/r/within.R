# Golden results of n-way within-subject ANOVA: for every within/*.csv writes within/<name>.json.
# Run from this folder: Rscript within.R [name ...]
suppressPackageStartupMessages({
  library(afex); library(car); library(emmeans); library(jsonlite)
})
afex_options(emmeans_model = "multivariate", type = 3)
emm_options(msg.interaction = FALSE, msg.nesting = FALSE)

number <- function(x) if (length(x) == 0 || !is.finite(x)) NULL else unbox(as.numeric(x))

cell_matrix <- function(data, factors) {
  cells <- aggregate(data["rating"], data[rev(c("participant", factors))], mean)
  grid <- do.call(expand.grid, lapply(rev(factors), function(f) levels(data[[f]])))
  names(grid) <- rev(factors)
  grid <- grid[factors]                                   # last factor fastest
  key <- function(d) do.call(paste, c(d[factors], sep = "|"))
  people <- levels(data$participant)
  y <- t(sapply(people, function(p) {
    mine <- cells[cells$participant == p, ]
    mine$rating[match(key(grid), key(mine))]
  }))
  if (nrow(grid) == 1 || nrow(y) != length(people)) y <- t(y)
  list(y = y, grid = grid, cells = cells, people = people)
}

fit_car <- function(m, factors) {
  y <- m$y
  colnames(y) <- apply(m$grid, 1, paste, collapse = "_")
  idata <- m$grid
  for (f in factors) contrasts(idata[[f]]) <- contr.sum(nlevels(idata[[f]]))
  design <- as.formula(paste("~", paste(factors, collapse = "*")))
  Anova(lm(y ~ 1), idata = idata, idesign = design, type = 3)
}

multivariate <- function(fit, effect, n) {
  ssp <- fit$SSP[[effect]]; sspe <- fit$SSPE[[effect]]
  q <- ncol(as.matrix(ssp))
  if (q > n - 1 || qr(as.matrix(sspe))$rank < q) return(NULL)
  values <- eigen(qr.coef(qr(sspe), ssp), symmetric = FALSE)$values
  pick <- function(test) {
    row <- switch(test,
      Pillai = stats:::Pillai(Re(values), 1, n - 1), Wilks = stats:::Wilks(Re(values), 1, n - 1),
      HL = stats:::HL(Re(values), 1, n - 1), Roy = stats:::Roy(Re(values), 1, n - 1))
    row
  }
  pillai <- pick("Pillai")
  list(pillai = number(pillai[1]), wilks = number(pick("Wilks")[1]), hotelling_lawley = number(pick("HL")[1]),
       roy = number(pick("Roy")[1]), f_value = number(pick("HL")[2]), df_effect = number(pillai[3]),
       df_error = number(pillai[4]),
       p_value = number(pf(pick("HL")[2], pillai[3], pillai[4], lower.tail = FALSE)))
}

# car gives no epsilon where the error matrix is singular (few participants); R's own stats does.
epsilons <- function(m, effect) {
  parts <- strsplit(effect, ":")[[1]]
  y <- m$y
  inner <- as.formula(paste("~", paste(parts, collapse = "*")))
  outer <- if (length(parts) == 1) ~1 else update(inner, as.formula(paste("~ . -", effect)))
  found <- stats:::sphericity(SSD(lm(y ~ 1)), M = inner, X = outer, idata = m$grid)
  c(gg = found$GG.eps, hf = found$HF.eps)
}

effect_results <- function(fit, aov, factors, m) {
  n <- nrow(m$y)
  s <- suppressWarnings(summary(fit, multivariate = FALSE))
  eps <- s$pval.adjustments; mauchly <- s$sphericity.tests; uni <- s$univariate.tests
  ges <- anova(aov, es = c("ges", "pes"), correction = "none")
  effects <- setdiff(rownames(uni), "(Intercept)")
  lapply(effects, function(e) {
    has <- uni[e, "num Df"] > 1 && !is.null(eps) && e %in% rownames(eps) && is.finite(eps[e, "GG eps"])
    own <- if (uni[e, "num Df"] == 1) c(gg = 1, hf = 1) else epsilons(m, e)
    gg <- if (has) eps[e, "GG eps"] else own[["gg"]]
    hf <- if (has) eps[e, "HF eps"] else own[["hf"]]
    if (has) stopifnot(abs(own - c(gg, hf)) < 1e-9)
    f <- uni[e, "F value"]; q <- uni[e, "num Df"]; r <- uni[e, "den Df"]
    adjusted <- function(epsilon) pf(f, q * min(1, epsilon), r * min(1, epsilon), lower.tail = FALSE)
    list(effect = unbox(e),
         univariate = list(ss = number(uni[e, "Sum Sq"]), ss_error = number(uni[e, "Error SS"]),
           df_effect = number(q), df_error = number(r), f_value = number(f),
           p_value = number(uni[e, "Pr(>F)"]), epsilon_gg = number(gg), p_gg = number(adjusted(gg)),
           epsilon_hf = number(hf), p_hf = number(adjusted(hf)),
           p_gg_car = if (has) number(eps[e, "Pr(>F[GG])"]), p_hf_car = if (has) number(eps[e, "Pr(>F[HF])"])),
         multivariate = multivariate(fit, e, n),
         mauchly_w = if (!is.null(mauchly) && e %in% rownames(mauchly)) number(mauchly[e, "Test statistic"]),
         mauchly_p_r = if (!is.null(mauchly) && e %in% rownames(mauchly)) number(mauchly[e, "p-value"]),
         eta_sq_partial = number(ges[e, "pes"]), eta_sq_generalized = number(ges[e, "ges"]))
  })
}

margins <- function(factors) {
  sets <- unlist(lapply(seq_along(factors), function(k) combn(factors, k, simplify = FALSE)), recursive = FALSE)
  Filter(function(s) length(s) <= 2 || length(s) == length(factors), sets)
}

marginal_means <- function(aov, factors) {
  unlist(lapply(margins(factors), function(s) {
    table <- as.data.frame(summary(emmeans(aov, s, model = "multivariate"), infer = c(TRUE, FALSE)))
    lapply(seq_len(nrow(table)), function(i) list(
      effect = unbox(paste(s, collapse = ":")),
      levels = lapply(as.list(table[i, s, drop = FALSE]), function(v) unbox(as.character(v))),
      mean = number(table$emmean[i]), se = number(table$SE[i]), df = number(table$df[i]),
      ci = c(table$lower.CL[i], table$upper.CL[i])))
  }), recursive = FALSE)
}

pairs_of <- function(aov, factors) {
  sets <- Filter(function(s) length(s) <= 2, margins(factors))
  unlist(lapply(sets, function(s) {
    grid <- emmeans(aov, s, model = "multivariate")
    labels <- apply(sapply(as.data.frame(grid@grid[s]), as.character), 1, paste, collapse = ",")
    if (length(s) == 1) labels <- as.character(grid@grid[[s]])
    contrast <- pairs(grid, adjust = "none")
    plain <- as.data.frame(summary(contrast, infer = c(TRUE, TRUE), adjust = "none"))
    bonferroni <- as.data.frame(summary(contrast, adjust = "bonferroni"))
    holm <- as.data.frame(summary(contrast, adjust = "holm"))
    which <- combn(length(labels), 2)
    lapply(seq_len(nrow(plain)), function(i) list(
      effect = unbox(paste(s, collapse = ":")), level_a = unbox(labels[which[1, i]]), level_b = unbox(labels[which[2, i]]),
      difference = number(plain$estimate[i]), se = number(plain$SE[i]), t = number(plain$t.ratio[i]),
      df = number(plain$df[i]), p = number(plain$p.value[i]), p_bonferroni = number(bonferroni$p.value[i]),
      p_holm = number(holm$p.value[i]), ci = c(plain$lower.CL[i], plain$upper.CL[i])))
  }), recursive = FALSE)
}

versions <- function() c(list(R = unbox(R.version.string)), lapply(
  c(afex = "afex", car = "car", emmeans = "emmeans"), function(p) unbox(as.character(packageVersion(p)))))

run_case <- function(name) {
  data <- read.csv(file.path("within", paste0(name, ".csv")), stringsAsFactors = TRUE)
  factors <- setdiff(names(data), c("participant", "rating"))
  m <- cell_matrix(data, factors)
  fit <- fit_car(m, factors)
  aov <- suppressWarnings(suppressMessages(
    aov_ez("participant", "rating", data, within = factors, fun_aggregate = mean, include_aov = FALSE)))
  result <- list(
    provenance = c(versions(), list(command = unbox(paste("Rscript within.R", name)), date = unbox(format(Sys.Date())))),
    factors = factors, levels = lapply(setNames(factors, factors), function(f) levels(data[[f]])),
    n_participants = unbox(nrow(m$y)), effects = effect_results(fit, aov, factors, m),
    marginal_means = marginal_means(aov, factors), pairwise = pairs_of(aov, factors))
  writeLines(toJSON(result, digits = I(17), pretty = FALSE, null = "null"), file.path("within", paste0(name, ".json")))
  cat(name, length(result$effects), "effects\n")
}

wanted <- commandArgs(trailingOnly = TRUE)
if (length(wanted) == 0) wanted <- sub("\\.csv$", "", list.files("within", "\\.csv$"))
for (name in wanted) run_case(name)
