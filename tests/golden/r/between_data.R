# The data of between.R: O'Brien & Kaiser (1985) as afex ships it, and seeded random designs with groups of unequal size.
obk <- function() {
  data("obk.long", package = "afex", envir = environment())
  d <- get("obk.long")[c("id", "treatment", "gender", "age", "phase", "hour", "value")]
  names(d)[names(d) == "value"] <- "y"
  d
}

random_design <- function(seed, groups, within, covariates = character(), digits = 3) {
  set.seed(seed)
  cells <- do.call(expand.grid, c(within, list(stringsAsFactors = FALSE)))
  people <- do.call(rbind, lapply(seq_along(groups), function(g) {
    levels <- strsplit(names(groups)[g], "-")[[1]]
    data.frame(matrix(levels, groups[g], length(levels), byrow = TRUE))
  }))
  names(people) <- c("g", "h", "k")[seq_len(ncol(people))]
  people$id <- sprintf("p%02d", seq_len(nrow(people)))
  for (x in covariates) people[[x]] <- round(rnorm(nrow(people), 30, 8), 1)
  rows <- if (length(within)) merge(people, cells, by = NULL) else people
  effect <- rnorm(nrow(people))[match(rows$id, people$id)]
  slope <- if (length(covariates)) (rows[[covariates[1]]] - 30) * 0.05 else 0
  shift <- rowSums(sapply(rows[setdiff(names(rows), c("id", covariates))], function(v) as.integer(factor(v)) * 0.3))
  rows$y <- round(4 + effect + slope + shift + rnorm(nrow(rows), 0, 0.8 + 0.3 * as.integer(factor(rows$g))), digits)
  rows[order(rows$id), ]
}

cases <- list(
  obk = list(within = c("phase", "hour"), between = c("treatment", "gender"), covariate = NULL),
  obk_age = list(within = c("phase", "hour"), between = c("treatment", "gender"), covariate = "age"),
  two_groups = list(within = "a", between = "g", covariate = NULL),
  three_within = list(within = c("a", "b", "c"), between = "g", covariate = "x"),
  between_only = list(within = NULL, between = c("g", "h"), covariate = c("x", "z")),
  covariate_only = list(within = c("a", "b"), between = NULL, covariate = "x"),
  few = list(within = "a", between = c("g", "h"), covariate = NULL))

tables <- list(
  obk = obk(), obk_age = obk(),
  two_groups = random_design(1, c(u = 7, v = 12), list(a = c("1", "2", "3", "4"))),
  three_within = random_design(2, c(u = 9, v = 6, w = 11), list(a = c("l", "m", "n"), b = c("p", "q"), c = c("r", "s", "t")), "x"),
  between_only = random_design(3, c("u-1" = 5, "u-2" = 9, "v-1" = 7, "v-2" = 4, "w-1" = 6, "w-2" = 8), list(), c("x", "z")),
  covariate_only = random_design(4, c(u = 18), list(a = c("l", "m", "n"), b = c("p", "q")), "x"),
  few = random_design(5, c("u-1" = 2, "u-2" = 1, "v-1" = 2, "v-2" = 3), list(a = c("1", "2", "3", "4", "5", "6"))))

for (name in names(tables)) write.csv(tables[[name]], file.path("between", paste0(name, ".csv")), row.names = FALSE, quote = FALSE)
