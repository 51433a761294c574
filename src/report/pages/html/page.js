// Chooses frames, sorts the headline table, shows all of its rows: without it all are there.
const all = (selector, from = document) => [...from.querySelectorAll(selector)];
const root = document.documentElement;
const chooser = document.querySelector(".chooser");
const labels = all("[data-toggle]").map((button) => button.dataset.toggle);
const state = {
  figure: chooser?.dataset.first || document.querySelector(".figure:has(.shot)")?.id,
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
  const order = head.getAttribute("aria-sort"), { first } = head.firstElementChild.dataset;
  // The best first, at the second click the worst.
  const isDown = order ? order === "ascending" : first !== "ascending";
  for (const other of all("#headline th")) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", isDown ? "descending" : "ascending");
  const compare = (a, b) => {
    const [x, y] = [a, b].map((row) => value(row.cells[column]));
    if (column === 0) return b.cells[0].textContent.localeCompare(a.cells[0].textContent, "en", { numeric: true });
    return Number.isNaN(x) || Number.isNaN(y) ? 0 : y - x;
  };
  const isNone = (row) => column > 0 && Number.isNaN(value(row.cells[column]));
  const sorted = rows.filter((row) => !isNone(row));
  sorted.sort((a, b) => (isDown ? compare(a, b) : compare(b, a)));
  rows[0].parentNode.append(...sorted, ...rows.filter(isNone));
  document.getElementById("order")?.remove();
}

// Opens what a fragment names: the frame of a square, a figure or a folded part.
function go(fragment) {
  const target = document.getElementById(fragment.slice(1));
  const square = all("a.cp").find((a) => a.hash === fragment);
  if (square) {
    const { figure, algorithm } = square.dataset;
    Object.assign(state, { figure, algorithms: new Set([algorithm]), rank: "worst" });
  } else if (target?.matches(".figure")) state.figure = target.id;
  target?.closest("details")?.setAttribute("open", "");
  if (chooser) show();
  (square ? document.getElementById("frames") : target)?.scrollIntoView();
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button, a");
  if (!button) return;
  const { choose, toggle, rank, figure } = button.dataset;
  if (choose) {
    state.figure = choose;
    history.replaceState(null, "", `#${choose}`);
  } else if (toggle) state.algorithms[state.algorithms.has(toggle) ? "delete" : "add"](toggle);
  else if (rank) state.rank = rank;
  else if (figure) {
    history.replaceState(null, "", button.hash);
    go(button.hash);
    event.preventDefault();
  } else if (button.id === "all") {
    document.getElementById("headline").classList.remove("long");
    button.parentNode.remove();
  } else if (button.closest("#headline thead")) sort(button.closest("th"));
  else if (button.hash) go(button.hash);
  if (chooser) show();
});
window.addEventListener("hashchange", () => go(location.hash));
go(location.hash);
