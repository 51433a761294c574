// Chooses frames, sorts the headline table, shows all of its rows: without it all are there.
const all = (selector, from = document) => [...from.querySelectorAll(selector)];
const root = document.documentElement;
const chooser = document.querySelector(".chooser");
const labels = all("[data-toggle]").map((button) => button.dataset.toggle);
const state = {
  figure: document.querySelector(".figure:has(.shot)")?.id,
  algorithms: new Set(labels.slice(0, Number(chooser?.dataset.shown))),
  rank: "worst",
};
root.classList.add("js");

function show() {
  for (const figure of all(".figure")) figure.classList.toggle("on", figure.id === state.figure);
  for (const shot of all(".shot")) {
    const { algorithm, rank } = shot.dataset;
    const isOf = labels.length === 0 || state.algorithms.has(algorithm);
    shot.classList.toggle("off", !isOf || Boolean(rank && rank !== state.rank));
  }
  const press = (name, isPressed) => {
    for (const button of all(`[data-${name}]`, chooser))
      button.setAttribute("aria-pressed", isPressed(button.dataset[name]));
  };
  press("choose", (id) => id === state.figure);
  press("toggle", (label) => state.algorithms.has(label));
  press("rank", (rank) => rank === state.rank);
}

// The sum of the numbers of a cell: a single one, or those of its squares.
function value(cell) {
  const numbers = (cell.dataset.value ?? cell.textContent).match(/-?\d[\d.]*(e-?\d+)?/g);
  return numbers ? numbers.reduce((sum, number) => sum + Number(number), 0) : NaN;
}

function sort(head) {
  const rows = all("#headline tbody tr"), column = head.cellIndex;
  const isDown = head.getAttribute("aria-sort") !== "descending";
  for (const other of all("#headline th")) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", isDown ? "descending" : "ascending");
  const compare = (a, b) => {
    const [x, y] = [a, b].map((row) => value(row.cells[column]));
    if (column === 0) return b.textContent.localeCompare(a.textContent, "en", { numeric: true });
    return Number.isNaN(x) || Number.isNaN(y) ? 0 : y - x;
  };
  const isNone = (row) => column > 0 && Number.isNaN(value(row.cells[column]));
  const sorted = rows.filter((row) => !isNone(row));
  sorted.sort((a, b) => (isDown ? compare(a, b) : compare(b, a)));
  rows[0].parentNode.append(...sorted, ...rows.filter(isNone));
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button, a");
  if (!button) return;
  const { choose, toggle, rank, figure, algorithm } = button.dataset;
  if (choose) state.figure = choose;
  else if (toggle) state.algorithms[state.algorithms.has(toggle) ? "delete" : "add"](toggle);
  else if (rank) state.rank = rank;
  else if (figure) {
    Object.assign(state, { figure, algorithms: new Set([algorithm]), rank: "worst" });
    document.getElementById("frames").scrollIntoView();
    event.preventDefault();
  } else if (button.id === "all") {
    document.getElementById("headline").classList.remove("long");
    button.parentNode.remove();
  } else if (button.closest("#headline thead")) sort(button.closest("th"));
  else if (button.hash) document.querySelector(`details${button.hash}`)?.setAttribute("open", "");
  show();
});
if (chooser) show();
