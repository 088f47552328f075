// Where a node goes when it is dropped, or moved by a key.

// Where a node is dropped on another one, by the position on its box from 0 to 1: before it, into it, or after it.
export const dropSide = (fraction, canHold) => (fraction < (canHold ? 0.25 : 0.5) ? "before" : fraction > (canHold ? 0.75 : 0.5) ? "after" : "in");

// The parent and the index of a drop; null where it has no place.
export function dropPlace(elements, target, side) {
  const element = elements[target];
  if (side === "in") return { parent: target, index: element.children.length };
  return element.parent === null ? null : { parent: element.parent, index: element.index + (side === "after" ? 1 : 0) };
}

// Where a node is moved by a key: among its siblings, out behind its parent, or into the sibling before it.
export function keyPlace(elements, number, key) {
  const { parent, index } = elements[number];
  const around = elements[parent];
  if (key === "ArrowUp") return index > 0 ? { parent, index: index - 1 } : null;
  if (key === "ArrowDown") return index + 1 < around.children.length ? { parent, index: index + 2 } : null;
  if (key === "ArrowLeft") return [around, elements[around.parent]].some((each) => !each || each.tag === "BehaviorTree") ? null : { parent: around.parent, index: around.index + 1 };
  if (index === 0) return null;
  const before = around.children[index - 1];
  return { parent: before, index: elements[before].children.length };
}
