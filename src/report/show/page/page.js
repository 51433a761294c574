// Chooses frames, enlarges their pictures, sorts the headline table: without it all are there.
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

const figures = all(".figure");
const slider = document.getElementById("slider");
const isOf = (shot) => labels.length === 0 || state.algorithms.has(shot.dataset.algorithm);

// The figures of the algorithms that the filter leaves.
function shown() {
  const shots = state.filter ? `.shot[data-is~="${state.filter}"]` : ".shot";
  const isUnseen = (figure) => !state.filter && !figure.querySelector(".shot");
  return figures.filter((figure) => isUnseen(figure) || all(shots, figure).some(isOf));
}

function show() {
  const list = shown();
  if (list.length > 0 && !list.some((figure) => figure.id === state.figure)) state.figure = list[0].id;
  for (const figure of figures) figure.classList.toggle("on", list.includes(figure) && figure.id === state.figure);
  for (const shot of all(".shot")) {
    const { rank } = shot.dataset;
    shot.classList.toggle("off", !isOf(shot) || Boolean(rank && rank !== state.rank));
  }
  const press = (name, isPressed) => {
    for (const button of all(`[data-${name}]`, chooser))
      button.setAttribute("aria-pressed", isPressed(button.dataset[name]));
  };
  press("choose", (id) => id === state.figure);
  press("toggle", (label) => state.algorithms.has(label));
  press("rank", (rank) => rank === state.rank);
  press("filter", (filter) => filter === state.filter);
  for (const button of all("[data-filter][data-algorithm]"))
    button.setAttribute("aria-pressed", button.dataset.filter === state.filter && isOf(button));
  for (const button of all("[data-choose]", chooser))
    button.hidden = !list.some((figure) => figure.id === button.dataset.choose);
  if (!slider) return;
  const place = list.findIndex((figure) => figure.id === state.figure);
  slider.max = Math.max(list.length - 1, 0);
  slider.value = place;
  slider.nextElementSibling.nextElementSibling.textContent = list.length ? `${place + 1} of ${list.length}` : "none";
}

// The fragment of a figure: of a frame its run and number, and the algorithm if only one is shown.
function address() {
  const frame = document.getElementById(state.figure)?.dataset.frame;
  const chosen = [...state.algorithms];
  const parts = frame && chosen.length === 1 ? [frame, chosen[0]] : [frame ?? state.figure];
  return "#" + parts.map(encodeURI).join("/");
}

function choose(id) {
  state.figure = id;
  show();
  history.replaceState(null, "", address());
}

function step(by) {
  const list = shown();
  const place = list.findIndex((figure) => figure.id === state.figure);
  const next = list[Math.min(Math.max(place + by, 0), list.length - 1)];
  if (next) choose(next.id);
}

// Shows the truth in the place of each estimate, or the estimates again.
function blink(isOn) {
  for (const own of all(".blink")) own.remove();
  if (!isOn) return;
  const figure = document.getElementById(state.figure) ?? document;
  for (const place of all('.shot:not(.off) [data-kind="estimate"]', figure)) {
    const from = place.closest(".shot").querySelector('[data-kind="truth"] svg');
    const truth = (from ?? figure.querySelector('.truth [data-kind="truth"] svg'))?.cloneNode(true);
    truth?.classList.add("blink");
    if (truth) place.append(truth);
  }
}

function enlarge(svg) {
  const dialog = document.createElement("dialog");
  dialog.append(svg.cloneNode(true));
  dialog.addEventListener("close", () => dialog.remove());
  dialog.addEventListener("click", () => dialog.close());
  document.body.append(dialog);
  dialog.showModal();
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
function go(fragment, algorithm) {
  const name = decodeURI(fragment.slice(1));
  const isFrame = ({ dataset: { frame } }) => frame && (name === frame || name.startsWith(`${frame}/`));
  const isNamed = (figure) => all(".shot", figure).some((shot) => name.endsWith(`/${shot.dataset.algorithm}`));
  const frame = figures.find((figure) => isFrame(figure) && isNamed(figure)) ?? figures.find(isFrame);
  const target = frame ?? document.getElementById(name);
  const own = algorithm ?? (frame && name.slice(frame.dataset.frame.length + 1));
  if (labels.includes(own)) state.algorithms = new Set([own]);
  const square = all("a.cp").find((a) => a.hash === fragment);
  if (square) {
    const { figure, algorithm } = square.dataset;
    Object.assign(state, { figure, algorithms: new Set([algorithm]), rank: "worst" });
  } else if (target?.matches(".figure")) state.figure = target.id;
  if (target?.matches(".figure") && !shown().includes(target)) {
    state.filter = "";
    if (!shown().includes(target)) state.algorithms.add(target.querySelector(".shot").dataset.algorithm);
  }
  target?.closest("details")?.setAttribute("open", "");
  if (chooser) show();
  (square || target?.matches(".figure") ? document.getElementById("frames") : target)?.scrollIntoView();
}

document.addEventListener("click", (event) => {
  const svg = event.target.closest(".pictures svg");
  if (svg) return enlarge(svg);
  const button = event.target.closest("button, a");
  if (!button) return;
  const { choose: id, toggle, rank, figure, algorithm, filter, step: by } = button.dataset;
  if (id) choose(id);
  else if (by) step(Number(by));
  else if (filter) {
    state.filter = button.getAttribute("aria-pressed") === "true" ? "" : filter;
    if (algorithm) go("#frames", algorithm);
  }
  else if (button.matches(".copy")) navigator.clipboard?.writeText(button.previousElementSibling.textContent);
  else if (toggle) state.algorithms[state.algorithms.has(toggle) ? "delete" : "add"](toggle);
  else if (rank) state.rank = rank;
  else if (figure) {
    history.replaceState(null, "", button.hash);
    go(button.hash);
    event.preventDefault();
  } else if (button.id === "all") {
    document.getElementById("headline").classList.remove("long");
    button.parentNode.remove();
  } else if (button.closest("#headline thead")) sort(button.closest("th"));
  else if (button.hash) {
    go(button.hash, algorithm);
    event.preventDefault();
    history.replaceState(null, "", button.hash);
  }
  if (chooser) show();
});
slider?.addEventListener("input", () => {
  const figure = shown()[slider.value];
  if (figure) choose(figure.id);
});
document.addEventListener("keydown", (event) => {
  if (event.target.closest?.("input, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "t" && !event.repeat) blink(true);
  const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (chooser && by && !document.querySelector("dialog")) step(by);
});
document.addEventListener("keyup", (event) => event.key === "t" && blink(false));
window.addEventListener("hashchange", () => go(location.hash));
go(location.hash);
