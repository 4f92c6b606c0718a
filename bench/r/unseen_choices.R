# Pairs and thresholds of data sets that no test here holds: Rscript unseen_choices.R FOLDER
# Abilities by glm (Davidson as a log-linear model), robust errors written out, thresholds by glm with psyphy's links.
suppressPackageStartupMessages({library(BradleyTerry2); library(jsonlite); library(psyphy); library(MASS)})
folder <- commandArgs(TRUE)[1]
num <- function(x) unbox(as.numeric(x))
# independent: glm on expanded rows; Davidson by Poisson log-linear
write1 <- function(name, d) write.csv(d, file.path(folder, paste0(name, ".csv")), row.names=FALSE, quote=FALSE)
bt <- function(name, d, order=FALSE, link="logit") { # columns left right winner(left/right)
  write1(name, d); it <- sort(unique(c(d$left,d$right)), method="radix")
  X <- sapply(it, function(k) (d$left==k) - (d$right==k))[, -1, drop=FALSE]
  if (order) X <- cbind(X, order=1)
  y <- as.integer(d$winner=="left"); m <- glm(y ~ X - 1, family=binomial(link), control=glm.control(epsilon=1e-14, maxit=100))
  s <- summary(m)$coefficients
  out <- list(command=unbox("pairs"), n=unbox(name), method=unbox(if(link=="logit")"bradley-terry" else "thurstone"), order=unbox(order), items=it, ability=c(0, s[seq_along(it)[-1]-1,1]), se=c(0, s[seq_along(it)[-1]-1,2]), p=c(1,s[seq_along(it)[-1]-1,4]), ll=num(logLik(m)), oe=if(order) s[nrow(s),] else numeric(0))
  if (!is.null(d$rater)) { u <- X * residuals(m, "response"); if (link=="logit") { g <- rowsum(u, d$rater); B <- vcov(m); G <- nrow(g); out$robust <- c(0, sqrt(diag(B %*% crossprod(g) %*% B)*G/(G-1))[seq_along(it)[-1]-1]) } }
  writeLines(toJSON(out, digits=I(17)), file.path(folder, paste0(name, if(order)".o", if(link!="logit")".t", ".json")))
}
david <- function(name, d) { write1(name, d); it <- sort(unique(c(d$left,d$right)), method="radix")
  # loglinear: three rows per comparison, multinomial by glm poisson with an effect for each pair
  a <- pmin(match(d$left,it), match(d$right,it)); b <- pmax(match(d$left,it), match(d$right,it)); w <- match(ifelse(d$winner=="left",d$left,ifelse(d$winner=="right",d$right,NA)), it)
  key <- paste(a,b); u <- unique(key); rows <- do.call(rbind, lapply(u, function(k) { s <- key==k; x <- a[s][1]; y <- b[s][1]; data.frame(pair=k, n=c(sum(w[s]==x,na.rm=TRUE), sum(w[s]==y,na.rm=TRUE), sum(is.na(w[s]))), x=c(x,y,NA), p=x, q=y) }))
  X <- sapply(seq_along(it)[-1], function(k) ifelse(is.na(rows$x), ((rows$p==k)+(rows$q==k))/2, rows$x==k)); tie <- as.integer(is.na(rows$x)); colnames(X) <- it[-1]
  m <- glm(n ~ factor(pair) + X + tie, poisson, rows, control=glm.control(epsilon=1e-14, maxit=200)); s <- summary(m)$coefficients; g <- grep("^X", rownames(s))
  writeLines(toJSON(list(command=unbox("pairs"), n=unbox(name), method=unbox("davidson"), order=unbox(FALSE), items=it, ability=c(0,s[g,1]), se=c(0,s[g,2]), p=c(1,s[g,4]), log_nu=s["tie",]), digits=I(17)), file.path(folder, paste0(name,".json"))) }
ex <- function(a, b, wa, wb, t=0*wa) { a <- as.character(a); b <- as.character(b); data.frame(left=gsub(",","",rep(a, wa+wb+t)), right=gsub(",","",rep(b, wa+wb+t)), winner=unlist(mapply(function(x,y,z) rep(c("left","right","tie"), c(x,y,z)), wa, wb, t))) }
cc <- countsToBinomial(citations); bt("citations", ex(cc$player1, cc$player2, cc$win1, cc$win2)); bt("citations", ex(cc$player1, cc$player2, cc$win1, cc$win2), link="probit")
data(baseball); bt("baseball", ex(baseball$home.team, baseball$away.team, baseball$home.wins, baseball$away.wins)); bt("baseball", ex(baseball$home.team, baseball$away.team, baseball$home.wins, baseball$away.wins), order=TRUE); bt("baseball", ex(baseball$home.team, baseball$away.team, baseball$home.wins, baseball$away.wins), order=TRUE, link="probit")
data(icehockey); i <- icehockey[icehockey$result!=.5,]; bt("icehockey", data.frame(left=as.character(i$visitor), right=as.character(i$opponent), winner=ifelse(i$result==1,"left","right")))
i <- icehockey; david("icehockey.ties", data.frame(left=as.character(i$visitor), right=as.character(i$opponent), winner=ifelse(i$result==1,"left",ifelse(i$result==0,"right","tie"))))
data(football); f <- football[football$season=="2009-10",]; david("football", data.frame(left=gsub(" ","_",f$home), right=gsub(" ","_",f$away), winner=ifelse(f$result==1,"left",ifelse(f$result==-1,"right","tie"))))
data(springall); s <- springall$contests; david("springall", ex(s$row, s$col, s$win, s$loss, s$tie))
data(CEMS); p <- CEMS$preferences; p <- p[!is.na(p$win1),]; p$w <- ifelse(p$tied==1,"tie",ifelse(p$win1==1,"left",ifelse(p$win2==1,"right",NA))); p <- p[!is.na(p$w),]
david("CEMS", data.frame(left=as.character(p$school1), right=as.character(p$school2), winner=p$w, rater=p$student))
q <- p[p$w!="tie",]; bt("CEMS.noties", data.frame(left=as.character(q$school1), right=as.character(q$school2), winner=q$w, rater=as.character(q$student)))
data(sound.fields); c1 <- sound.fields$comparisons; david("sound.fields", ex(paste0("f",c1$field1), paste0("f",c1$field2), c1$win1, c1$win2, c1$tie))
# thresholds
thr <- function(name, x, k, n, guess, link) { d <- data.frame(x=rep(x, n), response=unlist(mapply(function(k,n) rep(1:0, c(k,n-k)), k, n, SIMPLIFY=FALSE))); write1(name, d)
  m <- glm(cbind(k, n-k) ~ x, binomial(link), control=glm.control(epsilon=1e-13, maxit=200)); b <- coef(m); V <- vcov(m)
  th <- -b[1]/b[2]; g <- c(-1/b[2], b[1]/b[2]^2); writeLines(toJSON(list(command=unbox("thresholds"), link=unbox(if (is.character(link)) link else link$name), guess=unbox(guess), threshold=num(th), spread=num(1/b[2]), ll=num(sum(dbinom(k,n,fitted(m),log=TRUE)-lchoose(n,k))), dev=num(deviance(m)), df=num(df.residual(m))), digits=I(17)), file.path(folder, paste0(name,".json"))) }
data(menarche); thr("menarche", menarche$Age, menarche$Menarche, menarche$Total, 0, "probit")
thr("menarche.logit", menarche$Age, menarche$Menarche, menarche$Total, 0, "logit")
data(ecc2); e <- subset(ecc2, task=="DET" & Size==min(Size)); thr("ecc2.det", log10(e$Contr), e$Correct, e$Correct+e$Incorrect, .25, mafc.probit(4))
e <- subset(ecc2, task=="ID" & Size==min(Size)); thr("ecc2.id", log10(e$Contr), e$Correct, e$Correct+e$Incorrect, .25, mafc.logit(4))
