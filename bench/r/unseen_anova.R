# ANOVA, follow-ups and sizes of data sets that no test here holds: Rscript unseen_anova.R FOLDER
# Writes FOLDER/<name>.csv and FOLDER/<name>_<type>.json: how to ask, and what afex, car, emmeans, effectsize and BayesFactor answer.
suppressPackageStartupMessages({
  library(afex); library(car); library(emmeans); library(jsonlite); library(effectsize); library(BayesFactor)
})
afex_options(emmeans_model = "multivariate")
emm_options(msg.interaction = FALSE, msg.nesting = FALSE)
folder <- commandArgs(TRUE)[1]
shipped <- function(name, package) {
  file <- if (name == "auto.noise") "autonoise" else name
  data(list = file, package = package, envir = environment())
  as.data.frame(get(name))
}
number <- function(x) if (length(x) == 0 || !is.finite(x)) NULL else unbox(as.numeric(x))
plain <- function(x) sub("^X(?=[-0-9])", "", as.character(x), perl = TRUE)

wide <- function(data, columns, name, value) {
  data$id <- seq_len(nrow(data))
  long <- do.call(rbind, lapply(columns, function(k) {
    one <- data[setdiff(names(data), columns)]
    one[[name]] <- k
    one[[value]] <- data[[k]]
    one
  }))
  long
}
numbered <- function(data) { data$id <- seq_len(nrow(data)); data }

generated <- function() {
  set.seed(20261124)
  people <- data.frame(id = sprintf("%03d", 1:31), g = sample(c("u", "v", "w"), 31, TRUE, c(5, 3, 2)), age = round(rnorm(31, 40, 12)))
  cells <- expand.grid(id = people$id, dose = c(7, 9, 14), eye = c("l", "r"))
  rows <- merge(people, cells)
  spread <- c("7" = 1, "9" = 3, "14" = 12)
  rows$y <- 1e4 + rows$age / 10 + spread[as.character(rows$dose)] * rnorm(nrow(rows)) + 2 * (rows$g == "w") * (rows$eye == "r")
  rows[sample(nrow(rows)), ]
}
missing_cells <- function() {
  rows <- generated()
  twice <- rbind(rows, rows[1:60, ])
  twice$y <- twice$y + seq_along(twice$y) / 97
  twice[!(twice$id %in% c("004", "017") & twice$eye == "l" & twice$dose == 9), ]
}
tied <- function() {
  set.seed(7)
  rows <- expand.grid(id = 1:14, a = c("p", "q", "r"), b = c("no", "yes"))
  rows$y <- pmin(7, pmax(1, round(4 + (rows$a == "r") + (rows$id %% 3) + rnorm(nrow(rows), 0, .6))))
  rows
}

early <- shipped("Early", "mlmRev"); oxboys <- shipped("Oxboys", "mlmRev")
loss <- wide(shipped("WeightLoss", "carData"), c("wl1", "wl2", "wl3"), "month", "y")
baumann <- wide(shipped("Baumann", "carData"), c("post.test.1", "post.test.2", "post.test.3"), "test", "y")
threat <- shipped("StereotypeThreat", "psychotools")
threat <- wide(threat, c("numerical", "abstract", "verbal"), "part", "y")
pottery <- wide(shipped("Pottery", "carData"), c("Al", "Fe", "Mg", "Ca", "Na"), "element", "y")
case <- function(data, id, y, within = c(), between = c(), covariate = c())
  list(data = data, id = id, y = y, within = within, between = between, covariate = covariate)
cases <- list(
  BodyWeight = case(shipped("BodyWeight", "nlme"), "Rat", "weight", "Time", "Diet"),
  Early = case(early, "id", "cog", "age", "trt"),
  Oxboys = case(oxboys, "Subject", "height", "Occasion"),
  WeightLoss = case(loss, "id", "y", "month", "group"),
  Moore = case(numbered(shipped("Moore", "carData")), "id", "conformity", c(), c("partner.status", "fcategory")),
  Salaries = case(numbered(shipped("Salaries", "carData")), "id", "salary", c(), c("rank", "discipline", "sex"), "yrs.service"),
  Baumann = case(baumann, "id", "y", "test", "group", c("pretest.1", "pretest.2")),
  anorexia = case(numbered(shipped("anorexia", "MASS")), "id", "Postwt", c(), "Treat", "Prewt"),
  genotype = case(numbered(shipped("genotype", "MASS")), "id", "Wt", c(), c("Litter", "Mother")),
  RatPupWeight = case(shipped("RatPupWeight", "nlme"), "Litter", "weight", "sex", "Treatment", "Lsize"),
  puzzles = case(shipped("puzzles", "BayesFactor"), "ID", "RT", c("shape", "color")),
  PBG = case(shipped("PBG", "nlme"), "Rabbit", "deltaBP", c("Treatment", "dose")),
  Alfalfa = case(shipped("Alfalfa", "nlme"), "Block", "Yield", c("Variety", "Date")),
  Soils = case(shipped("Soils", "carData"), "Block", "pH", c("Contour", "Depth")),
  auto.noise = case(numbered(shipped("auto.noise", "emmeans")), "id", "noise", c(), c("size", "type", "side")),
  StereotypeThreat = case(threat, "id", "y", "part", c("condition", "ethnicity", "gender")),
  Pottery = case(pottery, "id", "y", "element", "Site"),
  epil = case(shipped("epil", "MASS"), "subject", "y", "period", "trt", c("base", "age")),
  Wafer = case(shipped("Wafer", "nlme"), "Wafer", "current", c("Site", "voltage")),
  generated = case(generated(), "id", "y", c("dose", "eye"), "g", "age"),
  generated.missing = case(missing_cells(), "id", "y", c("dose", "eye"), "g", "age"),
  generated.tied = case(tied(), "id", "y", c("a", "b")))

multivariate <- function(anova, effect) {
  h <- as.matrix(anova$SSP[[effect]]); e <- as.matrix(anova$SSPE[[effect]]); r <- anova$df[[effect]]; nu <- anova$error.df
  if (ncol(e) > nu || qr(e)$rank < ncol(e)) return(NULL)
  values <- Re(eigen(qr.coef(qr(e), h), symmetric = FALSE, only.values = TRUE)$values)
  rows <- lapply(list(pillai = stats:::Pillai, wilks = stats:::Wilks, hotelling_lawley = stats:::HL, roy = stats:::Roy), function(f) {
    s <- f(values, r, nu)
    list(value = number(s[1]), f_value = number(s[2]), df_effect = number(s[3]), df_error = number(s[4]),
      p_value = number(pf(s[2], s[3], s[4], lower.tail = FALSE)))
  })
  rows
}
sizes <- function(f, d1, d2, k) {
  # effectsize has L / (L + df error) of the noncentrality L; Steiger (2004) has L / (L + df effect + df error + 1)
  ci <- F_to_eta2(f, d1 * k, d2 * k, ci = .95, alternative = "two.sided")
  steiger <- function(eta) { l <- eta * d2 * k / (1 - eta); l / (l + d1 * k + d2 * k + 1) }
  omega <- F_to_omega2(f, d1, d2, ci = NULL)[[1]]
  # effectsize calls a negative omega squared zero
  list(omega_sq_partial = if (omega > 0) number(omega), eta_sq_partial_ci = steiger(c(ci$CI_low, ci$CI_high)))
}
# Greenhouse and Geisser's by definition, as car has none where the error matrix is singular; Huynh and Feldt's from it.
epsilons <- function(anova, effect) {
  root <- crossprod(anova$P[[effect]]); q <- ncol(root); nu <- anova$error.df
  s <- solve(root, anova$SSPE[[effect]])
  gg <- sum(diag(s))^2 / (q * sum(diag(s %*% s)))
  c(gg, if (q == 1) 1 else ((nu + 1) * q * gg - 2) / (q * (nu - q * gg)))
}
within_effect <- function(aov, effect) {
  s <- suppressWarnings(summary(aov$Anova, multivariate = FALSE))
  u <- s$univariate.tests
  f <- u[effect, "F value"]; d1 <- u[effect, "num Df"]; d2 <- u[effect, "den Df"]
  is_within <- any(strsplit(effect, ":")[[1]] %in% names(aov$Anova$idata))
  own <- if (is_within) epsilons(aov$Anova, effect) else c(1, 1)
  gg <- own[1]; hf <- own[2]
  p <- function(k) number(pf(f, d1 * k, d2 * k, lower.tail = FALSE))
  c(list(univariate = list(ss = number(u[effect, "Sum Sq"]), ss_error = number(u[effect, "Error SS"]), df_effect = number(d1),
    df_error = number(d2), f_value = number(f), p_value = p(1), epsilon_gg = number(gg), p_gg = p(gg),
    epsilon_hf = number(hf), p_hf = p(min(1, hf))), statistics = multivariate(aov$Anova, effect)), sizes(f, d1, d2, gg))
}
between_effect <- function(aov, effect) {
  t <- aov$Anova; f <- t[effect, "F value"]; d1 <- t[effect, "Df"]; d2 <- t["Residuals", "Df"]
  c(list(univariate = list(ss = number(t[effect, "Sum Sq"]), ss_error = number(t["Residuals", "Sum Sq"]), df_effect = number(d1),
    df_error = number(d2), f_value = number(f), p_value = number(pf(f, d1, d2, lower.tail = FALSE)))), sizes(f, d1, d2, 1))
}
noncentral <- function(t, df, p) uniroot(function(l) suppressWarnings(pt(t, df, l)) - p, t + c(-1, 1) * (6 + abs(t)), tol = 1e-13, maxiter = 5000)$root
pairs_of <- function(aov, factor, paired, n, bound) {
  grid <- emmeans(aov, factor)
  levels <- plain(grid@grid[[factor]]); two <- combn(length(levels), 2)
  ask <- function(how, ...) as.data.frame(summary(pairs(grid, adjust = how), ...))
  t <- ask("none", infer = c(TRUE, TRUE))
  adjusted <- lapply(c(p_bonferroni = "bonferroni", p_holm = "holm", p_fdr = "fdr"), function(h) ask(h)$p.value)
  # emmeans' 1 - (1 - p)^m loses the digits of a small p
  adjusted$p_sidak <- -expm1(nrow(t) * log1p(-t$p.value))
  lower <- as.data.frame(test(pairs(grid, adjust = "none"), null = -bound, side = ">", adjust = "none"))$p.value
  upper <- as.data.frame(test(pairs(grid, adjust = "none"), null = bound, side = "<", adjust = "none"))$p.value
  lapply(seq_len(nrow(t)), function(i) {
    paired <- paired && t$df[i] == n - 1
    dz <- if (paired) t$t.ratio[i] / sqrt(n)
    ci <- if (paired && abs(t$t.ratio[i]) < 25) c(noncentral(t$t.ratio[i], t$df[i], .975), noncentral(t$t.ratio[i], t$df[i], .025)) / sqrt(n)
    bf <- if (paired) exp(ttest.tstat(t$t.ratio[i], n1 = n, rscale = sqrt(2) / 2)[["bf"]])
    c(list(level_a = unbox(levels[two[1, i]]), level_b = unbox(levels[two[2, i]]), difference = number(t$estimate[i]), se = number(t$SE[i]),
      t = number(t$t.ratio[i]), df = number(t$df[i]), p = number(t$p.value[i]), ci = c(t$lower.CL[i], t$upper.CL[i]), dz = number(dz), dz_ci = ci,
      bayes_factor = number(bf), p_lower = number(lower[i]), p_upper = number(upper[i])), lapply(adjusted, function(a) number(a[i])))
  })
}
means_of <- function(aov, set) {
  t <- as.data.frame(summary(emmeans(aov, set), infer = c(TRUE, FALSE)))
  lapply(seq_len(nrow(t)), function(i) list(levels = lapply(as.list(t[i, set, drop = FALSE]), function(v) unbox(plain(v))),
    mean = number(t$emmean[i]), se = number(t$SE[i]), ci = c(t$lower.CL[i], t$upper.CL[i])))
}
simple_of <- function(aov, of, at) {
  # emmeans has T2 / q on (q, nu): Hotelling's exact F of the same T2 is on (q, nu - q + 1)
  t <- as.data.frame(joint_tests(aov, by = at)); t <- t[t[["model term"]] == of, , drop = FALSE]
  lapply(seq_len(nrow(t)), function(i) {
    q <- t$df1[i]; nu <- t$df2[i]
    list(of = unbox(of), at_factor = unbox(at), at = unbox(plain(t[[at]][i])), f_value = number(t$F.ratio[i] * (nu - q + 1) / nu))
  })
}
run <- function(name, case, type) {
  data <- case$data
  data <- data[c(case$id, case$y, case$within, case$between, case$covariate)]
  for (f in c(case$id, case$within, case$between)) data[[f]] <- factor(as.character(data[[f]]))
  write.csv(format(data, digits = 17, trim = TRUE), file.path(folder, paste0(name, ".csv")), row.names = FALSE, quote = FALSE)
  keep <- if (length(case$within)) {
    full <- table(data[[case$id]], interaction(data[case$within]))
    data[data[[case$id]] %in% rownames(full)[rowSums(full == 0) == 0], ]
  } else data
  keep <- droplevels(keep)
  for (x in case$covariate) keep[[x]] <- keep[[x]] - mean(tapply(keep[[x]], keep[[case$id]], mean))
  aov <- suppressWarnings(suppressMessages(aov_ez(case$id, case$y, keep, within = case$within, between = case$between,
    covariate = case$covariate, type = type, factorize = FALSE, fun_aggregate = mean, include_aov = FALSE)))
  table <- anova(aov, es = c("ges", "pes"), correction = "none")
  effects <- lapply(rownames(table), function(e) c(list(effect = unbox(e)),
    if (length(case$within)) within_effect(aov, e) else between_effect(aov, e),
    list(eta_sq_partial = number(table[e, "pes"]), eta_sq_generalized = number(table[e, "ges"]))))
  factors <- c(case$between, case$within); n <- nrow(aov$data$wide); bound <- sd(keep[[case$y]]) / 2
  sets <- c(as.list(factors), if (length(factors) > 1) combn(factors, 2, simplify = FALSE))
  answer <- list(command = unbox("anova"), id = unbox(case$id), y = unbox(case$y), within = case$within, between = case$between, covariate = case$covariate,
    type = unbox(type), bound = number(bound), n = number(n), effects = effects,
    means = unlist(lapply(sets, function(s) means_of(aov, s)), recursive = FALSE),
    pairs = setNames(lapply(factors, function(f) pairs_of(aov, f, f %in% case$within, n, bound)), factors),
    simple = if (length(case$within) && length(factors) > 1) simple_of(aov, case$within[[1]], setdiff(factors, case$within[[1]])[[1]]))
  writeLines(toJSON(answer, digits = I(17), null = "null"), file.path(folder, sprintf("%s_%d.json", name, type)))
}
for (name in names(cases)) for (type in 2:3) run(name, cases[[name]], type)
