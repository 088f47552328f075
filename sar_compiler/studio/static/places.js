// The target position of a node that is dropped, or moved with a key.

// The target of a drop on a box, by the position on the box from 0 to 1: before the node, into it, or after it.
export const dropSide = (fraction, canHold) => (fraction < (canHold ? 0.25 : 0.5) ? "before" : fraction > (canHold ? 0.75 : 0.5) ? "after" : "in");

// The parent and the index of a drop; null if the node cannot be dropped there.
export function dropPlace(elements, target, side) {
  const element = elements[target];
  if (side === "in") return { parent: target, index: element.children.length };
  return element.parent === null ? null : { parent: element.parent, index: element.index + (side === "after" ? 1 : 0) };
}

// The target of a move with a key: among its siblings, after its parent, or into the previous sibling.
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
