// Writes the built files as a C++ source: node embed.mjs DIST ASSETS.CPP
//
// Every file is compressed once, here. Together they have to stay within a budget, so that a page
// opens in a blink on a slow line and nobody adds a library without noticing.
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { extname, join, posix } from 'node:path';
import { gzipSync } from 'node:zlib';

const budget = 250_000;
const types = {
    '.html': 'text/html; charset=utf-8',
    '.js': 'text/javascript; charset=utf-8',
    '.css': 'text/css; charset=utf-8',
    '.svg': 'image/svg+xml',
};

const [dist, target] = process.argv.slice(2);

function files(folder) {
    return readdirSync(join(dist, folder), { withFileTypes: true })
        .sort((a, b) => (a.name < b.name ? -1 : 1))
        .flatMap((entry) =>
            entry.isDirectory()
                ? files(posix.join(folder, entry.name))
                : [posix.join(folder, entry.name)],
        );
}

/** Bytes as adjacent string literals of C++. */
function literal(bytes) {
    const lines = [];
    for (let at = 0; at < bytes.length; at += 32) {
        const octal = Array.from(bytes.subarray(at, at + 32), (byte) => '\\' + byte.toString(8).padStart(3, '0'));
        lines.push('    "' + octal.join('') + '"');
    }
    return lines.join('\n');
}

let total = 0;
const entries = files('').map((name) => {
    const gzip = gzipSync(readFileSync(join(dist, name)), { level: 9 });
    gzip[9] = 255; // the system it was packed on says nothing
    total += gzip.length;
    return `{"/${name}", "${types[extname(name)]}", std::string_view(\n${literal(gzip)}, ${gzip.length})}`;
});
if (total > budget) {
    console.error(`The dashboard is ${total} bytes compressed; ${budget} are allowed.`);
    process.exit(1);
}
writeFileSync(
    target,
    `#include <array>

#include "server/http/assets.h"

namespace remesh::http {
namespace {

constexpr std::array<Asset, ${entries.length}> kAssets{{
${entries.join(',\n')},
}};

}  // namespace

std::span<const Asset> dashboard_assets() {
    return kAssets;
}

}  // namespace remesh::http
`,
);
console.log(`dashboard: ${entries.length} files, ${total} bytes compressed`);
