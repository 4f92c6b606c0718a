# Mixed and ordinal models of data sets that no test here holds: Rscript unseen_models.R FOLDER
# Writes FOLDER/<name>.csv and FOLDER/<name>.json: how to ask, and what lmerTest (bobyqa run to its end, pbkrtest) and clmm answer.
suppressPackageStartupMessages({library(lme4); library(lmerTest); library(ordinal); library(jsonlite)})
folder <- commandArgs(TRUE)[1]
shipped <- function(name, package) { data(list = name, package = package, envir = environment()); as.data.frame(get(name)) }
num <- function(x) if (is.finite(x)) unbox(as.numeric(x)) else NULL
centre <- function(d, x, id) { m <- tapply(d[[x]], d[[id]], mean); v <- tapply(d[[x]], d[[id]], var); if (all(is.na(v) | v == 0)) d[[x]] - mean(m) else d[[x]] - mean(d[[x]]) }
mixed <- function(name, d, id, y, within=c(), between=c(), covariate=c(), item=c(), random=c(), slopes="none", extra="") {
  d <- d[complete.cases(d[c(id,y,within,between,covariate,item,random)]), ]
  for (f in c(id, within, between, item, random)) d[[f]] <- factor(as.character(d[[f]]))
  w <- d[c(id,y,within,between,covariate,item,random)]; write.csv(format(w, digits=17, trim=TRUE), file.path(folder, paste0(name,".csv")), row.names=FALSE, quote=FALSE)
  for (f in c(within, between)) contrasts(d[[f]]) <- contr.sum(nlevels(d[[f]]))
  for (x in covariate) d[[x]] <- centre(d, x, id)
  fixed <- paste(c(covariate, paste(c(between, within), collapse="*")), collapse=" + ")
  re <- sprintf("(1|%s)", c(id, item, random))
  if (slopes != "none") { # two-level factors: numeric +-1
    xs <- within; for (f in xs) d[[paste0(f,".n")]] <- ifelse(as.integer(d[[f]])==1, 1, -1)
    xn <- paste0(xs, ".n")
    # A covariate that varies within people has a slope wherever factors have one, correlated with the intercept.
    moving <- Filter(function(x) any(tapply(d[[x]], d[[id]], var) > 0, na.rm=TRUE), covariate)
    of_people <- paste(c("1", moving, if (slopes=="correlated") xn), collapse="+")
    own <- paste(xn, collapse=if (slopes=="all") "*" else "+")
    re[1] <- if (slopes=="correlated") sprintf("(%s|%s)", of_people, id) else if (length(moving))
      sprintf("(%s|%s) + (0+%s||%s)", of_people, id, own, id) else sprintf("(1+%s||%s)", own, id)
  }
  m <- suppressMessages(suppressWarnings(lmerTest::lmer(as.formula(paste(y, "~", fixed, "+", paste(re, collapse="+"))), d,
    control=lmerControl(optimizer="bobyqa", optCtrl=list(rhoend=1e-10, maxfun=1e5), check.conv.grad="ignore"))))
  a <- anova(m); k <- if (nrow(d) < 2500) anova(m, ddf="Kenward-Roger")
  writeLines(toJSON(list(command=unbox("mixed"), id=unbox(id), y=unbox(y), within=within, between=between, covariate=covariate, item=item, random=random, slopes=unbox(slopes),
    reml=num(REMLcrit(m)), sigma=num(sigma(m)), singular=unbox(isSingular(m)),
    effects=lapply(rownames(a), function(e) list(effect=unbox(e), F=num(a[e,"F value"]), d1=num(a[e,"NumDF"]), d2=num(a[e,"DenDF"]), p=num(a[e,"Pr(>F)"]),
      kF=if(!is.null(k)) num(k[e,"F value"]), kd2=if(!is.null(k)) num(k[e,"DenDF"]), kp=if(!is.null(k)) num(k[e,"Pr(>F)"]))),
    sds=as.numeric(as.data.frame(VarCorr(m))$sdcor[is.na(as.data.frame(VarCorr(m))$var2)])), digits=I(17), null="null"), file.path(folder, paste0(name,".json")))
}
ord <- function(name, d, id, y, within=c(), between=c(), covariate=c(), item=c()) {
  d <- d[complete.cases(d[c(id,y,within,between,covariate,item)]), ]
  for (f in c(id, within, between, item)) d[[f]] <- factor(as.character(d[[f]]))
  w <- d[c(id,y,within,between,covariate,item)]; write.csv(w, file.path(folder, paste0(name,".csv")), row.names=FALSE, quote=FALSE)
  for (f in c(within, between)) contrasts(d[[f]]) <- contr.sum(nlevels(d[[f]]))
  for (x in covariate) d[[x]] <- centre(d, x, id)
  d$.y <- factor(d[[y]], ordered=TRUE)
  fixed <- paste(c(covariate, paste(c(between, within), collapse="*")), collapse=" + ")
  m <- clmm(as.formula(paste(".y ~", fixed, "+", paste(sprintf("(1|%s)", c(id,item)), collapse="+"))), data=d, control=clmm.control(gradTol=1e-6))
  writeLines(toJSON(list(command=unbox("ordinal"), id=unbox(id), y=unbox(y), within=within, between=between, covariate=covariate, item=item,
    loglik=num(as.numeric(logLik(m))), eta=as.numeric(model.matrix(as.formula(paste("~", fixed)), d)[, -1, drop=FALSE] %*% m$beta), alpha=as.numeric(m$alpha), sds=as.numeric(unlist(lapply(VarCorr(m), function(v) attr(v,"stddev"))))), digits=I(17), null="null"), file.path(folder, paste0(name,".json")))
}
mixed("sleepstudy.days", shipped("sleepstudy","lme4"), "Subject","Reaction","Days")
d <- shipped("sleepstudy","lme4"); d$late <- ifelse(d$Days>=5,"late","early"); mixed("sleepstudy.cov", d, "Subject","Reaction","late",covariate="Days", slopes="correlated")
mixed("Pixel", shipped("Pixel","nlme"), "Dog","pixel","Side",covariate="day", slopes="main")
mixed("Wafer", shipped("Wafer","nlme"), "Wafer","current","voltage",item="Site")
mixed("Assay", transform(shipped("Assay","nlme"), row=paste(Block,sample)), "row","logDens","dilut",item="Block")
mixed("egsingle", shipped("egsingle","mlmRev"), "childid","math",between=c("female"),covariate=c("year","lowinc"),random="schoolid")
mixed("Blackmore", shipped("Blackmore","carData"), "subject","exercise",between="group",covariate="age")
mixed("Milk", shipped("Milk","nlme"), "Cow","protein",between="Diet",covariate="Time")
mixed("RatPupWeight", shipped("RatPupWeight","nlme"), "Litter","weight","sex","Treatment",covariate="Lsize", slopes="main")
mixed("Oxide", transform(shipped("Oxide","nlme"), W=paste(Lot,Wafer)), "Lot","Thickness","Site","Source",random="W")
mixed("puzzles", shipped("puzzles","BayesFactor"), "ID","RT",c("shape","color"), slopes="main")
mixed("Alfalfa", shipped("Alfalfa","nlme"), "Block","Yield",c("Variety","Date"))
mixed("epil", shipped("epil","MASS"), "subject","y","period","trt",covariate=c("base","age"))
mixed("nlschools", transform(shipped("nlschools","MASS")), "class","lang",between="COMB",covariate=c("IQ","SES"))
mixed("Gcsemv", shipped("Gcsemv","mlmRev"), "school","course","gender", slopes="main")
ord("VerbAgg", transform(shipped("VerbAgg","lme4"), r=as.integer(resp)), "id","r",c("mode","btype"),"Gender",covariate="Anger",item="item")
ord("Socatt", transform(shipped("Socatt","mlmRev"), n=as.integer(as.character(numpos))), "respond","n","year","religion")
d <- psych::bfi[1:250, ]; d$id <- seq_len(nrow(d))
l <- do.call(rbind, lapply(paste0("N", 1:5), function(k) data.frame(id=d$id, g=d$gender, item=k, r=d[[k]], age=d$age)))
ord("bfi.N", l, "id","r",between="g",covariate="age",item="item")
ord("epil.ord", transform(shipped("epil","MASS"), r=pmin(5, y %/% 3)), "subject","r","period","trt")
set.seed(11); n <- 40; g <- expand.grid(id=1:n, item=1:8, a=c("x","y","z")); g <- g[runif(nrow(g))<.8,]; u <- rnorm(n,0,1.2); v <- rnorm(8,0,.6)
g$r <- as.integer(cut(u[g$id]+v[g$item]+.5*(g$a=="y")-1*(g$a=="z")+rlogis(nrow(g)), c(-Inf,-2,-1,0,.2,2,Inf)))
ord("generated.ord", g, "id","r","a",item="item")
