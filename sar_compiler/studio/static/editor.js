// The text editor. CodeMirror is in a shadow root, where its styles do not violate the page's Content-Security-Policy.
import {
  bracketMatching, defaultKeymap, drawSelection, EditorState, EditorView, foldGutter, foldKeymap, highlightActiveLine,
  highlightSelectionMatches, HighlightStyle, history, historyKeymap, isolateHistory, keymap, lineNumbers, lintGutter, lintKeymap, redo,
  searchKeymap, setDiagnostics, syntaxHighlighting, tags, undo, xml, yaml,
} from "./codemirror.js";

const colours = HighlightStyle.define([
  { tag: [tags.tagName, tags.definition(tags.propertyName)], color: "var(--mark)" },
  { tag: [tags.attributeName, tags.propertyName], fontWeight: "600" },
  { tag: [tags.attributeValue, tags.string, tags.content], color: "var(--success)" },
  { tag: tags.comment, color: "var(--quiet)", fontStyle: "italic" },
]);
const theme = EditorView.theme({
  "&": { height: "100%", color: "var(--text)", backgroundColor: "var(--ground)", fontSize: "13px" },
  ".cm-gutters": { color: "var(--quiet)", backgroundColor: "var(--raised)" },
  ".cm-activeLine": { backgroundColor: "color-mix(in srgb, var(--mark) 8%, transparent)" },
  ".cm-cursor": { borderLeftColor: "var(--text)" },
  "&.cm-focused > .cm-scroller > .cm-selectionLayer .cm-selectionBackground, .cm-selectionBackground": {
    backgroundColor: "color-mix(in srgb, var(--mark) 30%, transparent)",
  },
  ".cm-panels, .cm-tooltip": { color: "var(--text)", backgroundColor: "var(--raised)" },
});

export class TextEditor {
  constructor(place, { onChange, onSelect }) {
    const root = place.attachShadow({ mode: "open" });
    this.view = new EditorView({ parent: root, root });
    this.extensions = [
      lineNumbers(), foldGutter(), lintGutter(), history(), drawSelection(), bracketMatching(), highlightActiveLine(),
      highlightSelectionMatches(), syntaxHighlighting(colours), theme,
      // Only \n separates lines, so that other line endings in the text are not changed.
      EditorState.lineSeparator.of("\n"),
      EditorView.contentAttributes.of({ "aria-label": "The tree file", tabindex: "0" }),
      keymap.of([...defaultKeymap, ...historyKeymap, ...foldKeymap, ...searchKeymap, ...lintKeymap]),
      EditorView.updateListener.of((update) => {
        if (update.docChanged) onChange(update.changes);
        else if (update.selectionSet && this.view.hasFocus) onSelect(update.state.selection.main.head);
      }),
    ];
  }

  // Shows another file, without the history of the previous file.
  open(text, form) {
    this.view.setState(EditorState.create({ doc: text, extensions: [...this.extensions, form === "yaml" ? yaml() : xml()] }));
  }

  get text() {
    return this.view.state.sliceDoc();
  }

  apply(changes) {
    this.view.dispatch({ changes: changes.map(({ from, to, insert }) => ({ from, to, insert })), annotations: isolateHistory.of("full") });
  }

  // Selects a range, which may belong to an older text.
  select(from, to) {
    const [anchor, head] = [from, to].map((each) => Math.min(each, this.view.state.doc.length));
    this.view.dispatch({ selection: { anchor, head }, effects: EditorView.scrollIntoView(anchor, { y: "center" }) });
  }

  show(findings, onFix) {
    const shown = findings.filter((each) => !each.file).map((each) => ({
      from: each.from, to: each.to, severity: each.severity, message: each.advice ? `${each.message}\n${each.advice}` : each.message,
      actions: each.fix ? [{ name: "Fix", apply: () => onFix(each.fix) }] : [],
    }));
    this.view.dispatch(setDiagnostics(this.view.state, shown));
  }

  undo() { undo(this.view); }
  redo() { redo(this.view); }
}
