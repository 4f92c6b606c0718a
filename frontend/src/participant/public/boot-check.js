// For browsers too old for the page itself: old JavaScript on purpose, so that it runs where nothing else does.
(function () {
  var modules = "noModule" in document.createElement("script");
  function failed() {
    var root = document.getElementById("study");
    if (!root || root.getAttribute("data-started")) return;
    root.innerHTML =
      '<div class="page"><h1>This browser is too old for the study</h1>' +
      "<p>Please open the link in a recent Chrome, Edge, Firefox or Safari, on a computer.</p>" +
      '<p lang="de">Dieser Browser ist zu alt f\u00fcr die Studie. Bitte \u00f6ffnen Sie den Link in einem aktuellen ' +
      "Chrome, Edge, Firefox oder Safari auf einem Computer.</p></div>";
    var parts = location.pathname.split("/");
    var report = new XMLHttpRequest();
    report.open("POST", "/api/unsupported");
    report.setRequestHeader("Content-Type", "application/json");
    report.send(JSON.stringify({ link_token: parts[parts.length - 1], reason: "old_browser", data: { user_agent: navigator.userAgent } }));
  }
  if (modules)
    window.addEventListener("load", function () {
      setTimeout(failed, 8000);
    });
  else failed();
})();
