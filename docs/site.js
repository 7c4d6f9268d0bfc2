// Equations are typeset after a page was loaded, by KaTeX, which is a part of the site.
document.addEventListener("DOMContentLoaded", () => {
  for (const each of document.querySelectorAll(".arithmatex")) {
    renderMathInElement(each, {
      delimiters: [
        { left: "\\(", right: "\\)", display: false },
        { left: "\\[", right: "\\]", display: true },
      ],
      throwOnError: true,
    });
  }
  // Short code, such as an option, is not broken behind its hyphens.
  for (const each of document.querySelectorAll(".md-typeset :not(pre, td) > code")) {
    if (each.textContent.length <= 24) each.style.whiteSpace = "nowrap";
  }
});
