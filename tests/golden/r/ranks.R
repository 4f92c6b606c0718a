# Rank tests by base R (stats), for tests/analysis/test_ranks.py. Run here: Rscript ranks.R
set.seed(53)
people <- 14
ratings <- matrix(round(pmin(7, pmax(1, outer(rnorm(people, 4, 1), c(0, .6, 1.2), "+") + rnorm(3 * people, 0, .8)))), people, 3, dimnames = list(NULL, c("a", "b", "c")))
smooth <- matrix(outer(rnorm(people, 4, 1), c(0, .5, -.4), "+") + rnorm(3 * people, 0, .7), people, 3, dimnames = list(NULL, c("a", "b", "c")))
groups <- rep(c("old", "mid", "new"), c(9, 12, 10))
measured <- round(rnorm(31, c(old = 3, mid = 4, new = 4.6)[groups], 1))
exactly <- rnorm(31, c(old = 3, mid = 4, new = 4.6)[groups], 1)
within <- function(y) {
  f <- friedman.test(y)
  pairs <- lapply(combn(3, 2, simplify = FALSE), function(p) {
    w <- suppressWarnings(wilcox.test(y[, p[1]], y[, p[2]], paired = TRUE))
    list(first = colnames(y)[p[1]], second = colnames(y)[p[2]], v = unname(w$statistic), p = w$p.value)
  })
  list(values = unname(lapply(seq_len(nrow(y)), function(i) unname(y[i, ]))), chi2 = unname(f$statistic), p = f$p.value, pairs = pairs)
}
between <- function(y) {
  k <- kruskal.test(y, factor(groups))
  r <- rank(y); n <- table(groups)[c("old", "mid", "new")]; N <- length(y)
  ties <- sum(table(y)^3 - table(y)) / (12 * (N - 1))
  pairs <- lapply(combn(names(n), 2, simplify = FALSE), function(p) {
    w <- suppressWarnings(wilcox.test(y[groups == p[1]], y[groups == p[2]]))
    z <- (mean(r[groups == p[1]]) - mean(r[groups == p[2]])) / sqrt((N * (N + 1) / 12 - ties) * (1 / n[[p[1]]] + 1 / n[[p[2]]]))
    list(first = p[1], second = p[2], u = unname(w$statistic), p = w$p.value, z = z)
  })
  dunn <- p.adjust(sapply(pairs, function(q) 2 * pnorm(-abs(q$z))), "holm")
  list(values = y, groups = groups, chi2 = unname(k$statistic), p = k$p.value, pairs = pairs, dunn = dunn)
}
numbers <- function(x) {
  if (is.list(x) && !is.null(names(x))) paste0("{", paste0('"', names(x), '": ', sapply(x, numbers), collapse = ", "), "}")
  else if (is.list(x)) paste0("[", paste(sapply(x, numbers), collapse = ", "), "]")
  else if (is.character(x)) { q <- paste0('"', x, '"'); if (length(q) == 1) q else paste0("[", paste(q, collapse = ", "), "]") }
  else { q <- sprintf("%.17g", x); if (length(q) == 1) q else paste0("[", paste(q, collapse = ", "), "]") }
}
writeLines(numbers(list(tied = within(ratings), untied = within(smooth), groups_tied = between(measured), groups_untied = between(exactly))), "ranks.json")
