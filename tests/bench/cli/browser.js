// Faults of a page that its reader sees; `own` is its window.
function text(own) {
  return own.textContent.trim().replace(/\s+/g, " ").slice(0, 60);
}

// Texts that are cut off, or lie over each other, and whether the page is wider than its window.
function faults(own) {
  const { document: page } = own;
  const found = [];
  const { scrollWidth, clientWidth } = page.documentElement;
  if (scrollWidth > clientWidth + 1) found.push(`wide: ${scrollWidth} of ${clientWidth} px`);
  const table = page.querySelector("#headline")?.parentNode;
  if (table?.scrollWidth > table?.clientWidth + 1) found.push(`headline: ${table.scrollWidth} of ${table.clientWidth} px`);
  const isSeen = (element) => element.checkVisibility({ contentVisibilityAuto: true, visibilityProperty: true });
  for (const element of page.querySelectorAll("th, td, p, li, h1, h2, h3, button, summary")) {
    const style = own.getComputedStyle(element);
    const isCut = style.overflowX === "hidden" && style.textOverflow !== "ellipsis";
    if (isSeen(element) && isCut && element.scrollWidth > element.clientWidth + 1) found.push(`cut: ${text(element)}`);
  }
  const boxes = [];
  const walker = page.createTreeWalker(page.body, 4);
  while (walker.nextNode()) {
    const node = walker.currentNode, parent = node.parentElement;
    if (!node.data.trim() || !isSeen(parent) || parent.closest("title, script, style, .store, summary ~ *:not(details[open] *)")) continue;
    // Scrolled texts are cut on purpose.
    if (parent.closest(".scroll, .pills, .chooser")) continue;
    const range = page.createRange();
    range.selectNodeContents(node);
    for (const { left, top, right, bottom } of range.getClientRects())
      if (right - left > 1) boxes.push({ left, top, right, bottom, node });
  }
  boxes.sort((a, b) => a.top - b.top);
  boxes.forEach((a, i) => {
    for (const b of boxes.slice(i + 1)) {
      if (b.top >= a.bottom - 3) break;
      const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (a.node !== b.node && wide > 3 && high > 5) found.push(`over each other: ${text(a.node)} | ${text(b.node)}`);
    }
  });
  return found.slice(0, 8);
}

const key = (own, type, name) => own.document.dispatchEvent(new own.KeyboardEvent(type, { key: name, bubbles: true }));
const on = (own) => own.document.querySelector(".figure.on")?.id;
