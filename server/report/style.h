#pragma once

#include <string_view>

namespace remesh::report {

/// Looks of the page, in light and in dark.
inline constexpr std::string_view kStyle = R"(
:root{--page:#f6f6f3;--card:#fff;--text:#1b1f23;--muted:#5d656d;--line:#e3e3de;--first:#0b7d73;--second:#c2571a;--third:#6b62b8;--before:#b9bbb4;--bad:#b3261e;color-scheme:light dark}
@media (prefers-color-scheme:dark){:root{--page:#111416;--card:#191d20;--text:#e7e9ea;--muted:#9aa3aa;--line:#2a3035;--first:#4cc3b5;--second:#f0945a;--third:#a79cf0;--before:#59626a;--bad:#f2857d}}
@media print{:root{--page:#fff}figure,table{break-inside:avoid}}
*{box-sizing:border-box}
html{font:15px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,'DejaVu Sans',sans-serif;font-variant-numeric:tabular-nums;color:var(--text);background:var(--page)}
body{margin:0}
main{max-width:1140px;margin:0 auto;padding:36px 24px 64px}
h1,h2,h3{margin:0;font-weight:620;letter-spacing:-.015em;overflow-wrap:anywhere}
h1{font-size:1.8rem}
h2{margin:40px 0 12px;font-size:1.12rem}
h3{font-size:1rem;font-weight:570}
p{margin:4px 0}
small,.hint,figcaption,figure p{color:var(--muted);font-weight:400;font-size:.88rem}
figure{min-width:0;margin:0;padding:16px 18px;border:1px solid var(--line);border-radius:10px;background:var(--card)}
.pictures{display:flex;flex-wrap:wrap;gap:16px;margin:22px 0 12px}
.pictures figure{flex:1;min-width:240px;text-align:center}
.pictures img{max-width:100%;height:auto;max-height:520px}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,480px),1fr));gap:16px}
.pair{display:flex;flex-wrap:wrap;gap:20px;margin-top:10px}
.pair div{flex:1;min-width:180px}
figure b{color:var(--text)}
svg{display:block;width:100%;overflow:visible}
svg text{fill:var(--muted);font-size:10px}
rect.before{fill:var(--before)}
rect.after{fill:var(--first)}
.mean{stroke:var(--text);stroke-width:1;stroke-dasharray:2 3}
.verdict{margin-top:8px;font-size:1.05rem}
.broken{margin:14px 0;padding:12px 16px;border:1px solid var(--bad);border-radius:10px}
.broken b{color:var(--bad)}
h3 small{display:block}
.axis,.grid line.grid,line.grid{stroke:var(--line);stroke-width:1}
polyline{fill:none;stroke-width:1.6}
polyline.first{stroke:var(--first)}
polyline.second{stroke:var(--second)}
polyline.third{stroke:var(--third)}
.legend span{margin-right:18px}
.legend i{display:inline-block;width:14px;height:3px;margin-right:6px;border-radius:2px;vertical-align:middle;background:currentcolor}
.legend .first i{background:var(--first)}
.legend .second i{background:var(--second)}
.legend .third i{background:var(--third)}
.scale{display:flex;align-items:center;gap:10px;font-size:.88rem;color:var(--muted)}
.scale i{width:180px;height:9px;border-radius:5px;background:linear-gradient(to right,#a50026,#f46d43 40%,#fee090 70%,#abd6e6 88%,#5892c4)}
table{width:100%;border-collapse:collapse;border:1px solid var(--line);border-radius:10px;background:var(--card)}
th,td{padding:7px 16px;text-align:left;vertical-align:top;border-top:1px solid var(--line);font-weight:400;overflow-wrap:anywhere}
thead th{color:var(--muted);font-size:.88rem}
.right{text-align:right;white-space:nowrap}
)";

}  // namespace remesh::report
