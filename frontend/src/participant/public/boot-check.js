// Why the page has not begun. Old JavaScript on purpose, so that it runs where nothing else does.
(function () {
  var modules = "noModule" in document.createElement("script");
  var lost = false;
  var old =
    "<h1>This browser is too old for the study</h1>" +
    "<p>Please open the link in a recent Chrome, Edge, Firefox or Safari, on a computer.</p>" +
    '<p lang="de">Dieser Browser ist zu alt f\u00fcr die Studie. Bitte \u00f6ffnen Sie den Link in einem aktuellen ' +
    "Chrome, Edge, Firefox oder Safari auf einem Computer.</p>";
  var away =
    '<h1>The connection failed</h1><p><a href="">Reload the page</a></p>' +
    '<p lang="de">Die Verbindung ist ausgefallen. <a href="">Seite neu laden</a></p>';
  function tell(text) {
    var root = document.getElementById("study");
    if (!root || root.getAttribute("data-started")) return false;
    root.innerHTML = '<div class="page">' + text + "</div>";
    return true;
  }
  function failed() {
    if (lost || !tell(old)) return;
    var parts = location.pathname.split("/");
    var report = new XMLHttpRequest();
    report.open("POST", "/api/unsupported");
    report.setRequestHeader("Content-Type", "application/json");
    report.send(JSON.stringify({ link_token: parts[parts.length - 1], reason: "old_browser", data: { user_agent: navigator.userAgent } }));
  }
  // A script that did not come: loaded again three times, then by hand, as where nothing can be counted.
  function again(event) {
    // Others' scripts, an extension's for one, are lost without harm.
    if (event.target.nodeName !== "SCRIPT" || event.target.src.indexOf("/assets/") < 0 || !tell(away)) return;
    lost = true;
    var loads;
    try {
      loads = Number(sessionStorage.loads || 0);
      sessionStorage.loads = (loads + 1) % 4;
    } catch (denied) {
      // Nothing can be counted, or nothing more is kept: by hand.
      loads = 3;
    }
    if (loads < 3)
      setTimeout(function () {
        if (tell(away)) location.reload();
      }, 1000);
  }
  if (!modules) return failed();
  window.addEventListener("error", again, true);
  window.addEventListener("load", function () {
    setTimeout(failed, 8000);
  });
})();
