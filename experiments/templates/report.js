const grammar = JSON.parse(document.getElementById("chart-grammar").textContent);
const dark = matchMedia("(prefers-color-scheme: dark)");
const draw = () => vegaEmbed("#chart", grammar, {
  renderer: "svg", // follows the page's colours and prints sharp
  actions: { export: true, source: false, compiled: false, editor: false },
  tooltip: { theme: dark.matches ? "dark" : "light" },
});
await draw();
dark.addEventListener("change", draw);
// What is folded away is printed all the same.
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
