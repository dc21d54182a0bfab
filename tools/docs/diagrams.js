// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Draws the diagrams of the site (```mermaid in the documents) with the colours of the page, again when those change.
// Without JavaScript, or where a diagram cannot be drawn, its text stays.
(() => {
  const blocks = [...document.querySelectorAll("pre.diagram")];
  if (blocks.length === 0 || typeof mermaid === "undefined") return;
  const sources = blocks.map((block) => block.textContent);

  const draw = async () => {
    const dark = document.body.getAttribute("data-md-color-scheme") === "slate";
    mermaid.initialize({ startOnLoad: false, securityLevel: "strict", theme: dark ? "dark" : "neutral", fontFamily: "sans-serif" });
    for (const [number, source] of sources.entries()) {
      try {
        const { svg } = await mermaid.render(`diagram-${number}`, source);
        blocks[number].innerHTML = svg;
        blocks[number].classList.add("drawn");
      } catch (error) {
        console.error(`diagram ${number + 1} of this page: ${error}`);
      }
    }
  };
  draw();
  new MutationObserver(draw).observe(document.body, { attributes: true, attributeFilter: ["data-md-color-scheme"] });
})();
