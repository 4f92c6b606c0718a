# Golden mixed models where the arithmetic is delicate: Kenward-Roger tests at 2 df (three people), a profile with flat parts.
# Run from this folder: Rscript hard_cases.R. Writes hard_cases.json. Data: hard_three_people.csv, hard_flat_profile.csv (make_data.py).
suppressPackageStartupMessages({library(lme4); library(lmerTest); library(pbkrtest); library(jsonlite)})
options(contrasts = c("contr.sum", "contr.poly"))
tight <- lmerControl(optimizer = "bobyqa", calc.derivs = FALSE, check.conv.singular = "ignore", optCtrl = list(rhoend = 1e-9))
read <- function(name) {
  d <- read.csv(name, stringsAsFactors = TRUE)
  d$participant <- factor(d$participant)
  d
}

d <- read("hard_three_people.csv")
d$x <- 3 - 2 * as.integer(d$A)
few <- lmerTest::lmer(score ~ A + (1 | participant) + (0 + x | participant) + (1 | item), d, control = tight)
test <- anova(few, type = 3, ddf = "Kenward-Roger")

flat <- read("hard_flat_profile.csv")
fit <- lme4::lmer(score ~ A + (1 | participant) + (1 | participant:A) + (1 | item), flat, control = tight)
ci <- confint(profile(fit, signames = FALSE, maxpts = 200, delta = 0.1, delta.cutoff = 1 / 40), level = 0.95)
print(test); print(ci)
intervals <- lapply(rownames(ci), function(n) list(name = unbox(n), low = unbox(ci[n, 1]), high = unbox(ci[n, 2])))
result <- list(provenance = list(R = unbox(R.version.string), lme4 = unbox(as.character(packageVersion("lme4"))),
  pbkrtest = unbox(as.character(packageVersion("pbkrtest"))), command = unbox("Rscript hard_cases.R"), date = unbox(format(Sys.Date()))),
  three_people = list(f_value = unbox(test[1, "F value"]), df_error = unbox(test[1, "DenDF"]), p_value = unbox(test[1, "Pr(>F)"])),
  intervals = intervals)
writeLines(toJSON(result, digits = I(15), pretty = TRUE, na = "null"), "hard_cases.json")
