import type { Defect, Frame, Quality, Warning } from '../api';
import { count, lengthsIn, number, spaceName, unitSign } from '../format';

const readable = (code: string) => code.toLowerCase().replaceAll('_', ' ');

/** What a person should know, but for what is told as a repair further down. */
export function Warnings(props: { warnings: Warning[]; told: Defect[] }) {
    const told = new Set(props.told.map((defect) => defect.code));
    const warnings = props.warnings.filter((warning) => !told.has(warning.code));
    if (warnings.length === 0) {
        return null;
    }
    return (
        <ul class="notice warning" aria-label="Warnings">
            {warnings.map((warning, i) => (
                <li key={i}>
                    <strong>{readable(warning.code)}</strong> {warning.message}
                </li>
            ))}
        </ul>
    );
}

/** What was wrong with the input, and what was done about it. */
export function Defects(props: { quality: Quality; frame: Frame | undefined }) {
    const defects = props.quality.defects ?? [];
    const meaning = [unitSign(props.frame), spaceName(props.frame)].filter(Boolean).join(', ');
    return (
        <section aria-labelledby="defects-title">
            <div class="section-title">
                <h2 id="defects-title">Found and repaired</h2>
                {defects.length > 0 && <span class="muted">{lengthsIn(props.frame)}</span>}
            </div>
            {defects.length === 0 ? (
                <p class="card nothing">Nothing was wrong with this surface.</p>
            ) : (
                <ul class="card defects">
                    {defects.map((defect, i) => (
                        <li key={i}>
                            <span class="badge">{count(defect.count)}</span>
                            <div>
                                <strong>{readable(defect.code)}</strong>
                                <p>{defect.description}</p>
                                {defect.at && defect.at.length === 3 && (
                                    <small class="muted">
                                        at x, y, z = {defect.at.map((x) => number(x, 4)).join(', ')} {meaning && `(${meaning})`}
                                    </small>
                                )}
                            </div>
                        </li>
                    ))}
                </ul>
            )}
        </section>
    );
}
