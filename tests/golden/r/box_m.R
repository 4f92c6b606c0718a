# Box's M by its definition (Box 1949), from R's cov and determinant. Run from this folder: Rscript box_m.R.
d <- read.csv("box_m.csv"); w <- reshape(transform(d, cell = paste(A, B))[, c("id", "group", "cell", "score")],
  idvar = c("id", "group"), timevar = "cell", direction = "wide")
s <- split(w[, -(1:2)], w$group); nu <- sapply(s, nrow) - 1; p <- 4; g <- length(s)
pooled <- Reduce(`+`, Map(function(x, n) n * cov(x), s, nu)) / sum(nu)
m <- sum(nu) * log(det(pooled)) - sum(nu * sapply(s, function(x) log(det(cov(x)))))
correction <- (2 * p^2 + 3 * p - 1) / (6 * (p + 1) * (g - 1)) * (sum(1 / nu) - 1 / sum(nu))
chi2 <- (1 - correction) * m; df <- p * (p + 1) * (g - 1) / 2
jsonlite::write_json(list(m = m, chi2 = chi2, df = df, p_value = pchisq(chi2, df, lower.tail = FALSE),
  provenance = R.version.string), "box_m.json", auto_unbox = TRUE, digits = 15)
