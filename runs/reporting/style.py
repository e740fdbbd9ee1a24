"""The look of a report: one column that fits a phone, light and dark, wide tables scroll in their own box."""

STYLE = """
:root { color-scheme: light dark; --paper: #fbfaf8; --card: #ffffff; --ink: #1d2125; --soft: #5a636c; --line: #dcdfe2;
  --accent: #00558c; --mark: #f1f4f6; }
@media (prefers-color-scheme: dark) { :root { --paper: #14171a; --card: #1c2024; --ink: #e7e9eb; --soft: #a3adb6;
  --line: #343a40; --accent: #7cc0ec; --mark: #24292e; } }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", "Liberation Sans", Roboto, Arial, sans-serif; }
main, header, footer { max-width: 66rem; margin: 0 auto; padding: 0 1.25rem; overflow-wrap: break-word; }
header { padding-top: 2.5rem; }
footer { padding-top: 1rem; padding-bottom: 3rem; color: var(--soft); font-size: .9rem; }
h1 { font-size: clamp(1.45rem, 1.1rem + 1.6vw, 2.1rem); line-height: 1.2; margin: .2rem 0 .6rem; text-wrap: balance; }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .7rem; padding-top: .9rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.05rem; margin: 1.8rem 0 .5rem; }
.kind { color: var(--soft); margin: 0; font-size: .9rem; letter-spacing: .03em; }
.answer { font-size: 1.1rem; border-left: .25rem solid var(--accent); padding: .1rem 0 .1rem 1rem; margin: 1rem 0; }
a { color: var(--accent); }
p, li { max-width: 75ch; }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(9.5rem, 1fr)); gap: .75rem;
  margin: 1.4rem 0; padding: 0; }
.facts div { background: var(--card); border: 1px solid var(--line); border-radius: .5rem; padding: .7rem .9rem; }
.facts dt { color: var(--soft); font-size: .85rem; }
.facts dd { margin: .15rem 0 0; font-size: 1.08rem; font-variant-numeric: tabular-nums; }
.scroll { overflow-x: auto; max-width: 100%; border: 1px solid var(--line); border-radius: .5rem;
  background: var(--card); margin: .8rem 0 1.2rem; }
.scroll:focus-visible, summary:focus-visible, a:focus-visible { outline: 2px solid var(--accent); outline-offset: 2px; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding: .6rem .8rem; color: var(--soft); }
caption span { display: block; max-width: min(75ch, 75vw); }
th, td { padding: .38rem .8rem; text-align: right; white-space: nowrap; border-top: 1px solid var(--line); }
thead th { border-top: 0; background: var(--mark); font-weight: 600; }
td.words, th.words { text-align: left; }
td.long { white-space: normal; min-width: 16rem; max-width: 46rem; text-align: left; }
figure { margin: 1rem 0 1.6rem; }
.picture { background: #ffffff; border: 1px solid var(--line); border-radius: .5rem; padding: .6rem; overflow-x: auto; }
.picture svg, .picture img { display: block; width: 100%; height: auto; margin: 0 auto; }
.picture.wide svg, .picture.wide img { min-width: 40rem; }
.picture.tall svg, .picture.tall img { max-width: 42rem; }
figcaption { color: var(--soft); font-size: .92rem; margin-top: .45rem; max-width: 75ch; }
pre { background: var(--card); border: 1px solid var(--line); border-radius: .5rem; padding: .8rem 1rem;
  overflow-x: auto; margin: .6rem 0 1rem;
  font: .85rem/1.5 ui-monospace, "Liberation Mono", Menlo, Consolas, monospace; }
code { font: .9em ui-monospace, "Liberation Mono", Menlo, Consolas, monospace; background: var(--mark);
  padding: .05em .3em; border-radius: .25rem; }
pre code { background: none; padding: 0; font-size: 1em; }
details { margin: .8rem 0; } summary { cursor: pointer; color: var(--accent); padding: .2rem 0; }
.note { border-left: .25rem solid #c77700; padding-left: .8rem; }
@media print { .scroll, pre, .picture { overflow: visible; } details > * { display: block; } }
"""
