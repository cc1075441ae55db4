import { render } from 'preact';
import { useEffect, useState } from 'preact/hooks';

import { api, setSignedOutListener, type Capabilities } from './api';
import { JobPage } from './pages/job';
import { QueuePage } from './pages/queue';
import { SignInPage } from './pages/sign_in';
import { SubmitPage } from './pages/submit';
import { Shell } from './parts/shell';
import { navigate, onNavigate, path } from './router';
import './style.css';
import { apply } from './theme';

function App() {
    const [at, setAt] = useState(path());
    const [isSignedOut, setSignedOut] = useState(false);
    const [hasSession, setSession] = useState(false);
    const [capabilities, setCapabilities] = useState<Capabilities | null>(null);

    useEffect(() => onNavigate(() => setAt(path())), []);
    useEffect(() => setSignedOutListener(() => setSignedOut(true)), []);
    useEffect(() => {
        api.capabilities().then(setCapabilities, () => {});
        api.session().then(
            (session) => setSession(session.signed_in),
            () => {},
        );
    }, [isSignedOut]);
    const signOut = async () => {
        await api.signOut();
        setSession(false);
        setSignedOut(true);
        navigate('/sign-in');
    };

    if (isSignedOut || at === '/sign-in') {
        return (
            <Shell at="/sign-in" capabilities={capabilities}>
                <SignInPage onSignedIn={() => setSignedOut(false)} />
            </Shell>
        );
    }
    const job = /^\/jobs\/([a-z0-9-]+)\/([a-z0-9-]+)$/.exec(at);
    return (
        <Shell at={at} capabilities={capabilities} onSignOut={hasSession ? () => void signOut() : undefined}>
            {job ? (
                <JobPage key={at} name={`tenants/${job[1]}/jobs/${job[2]}`} />
            ) : at === '/new' ? (
                <SubmitPage capabilities={capabilities} />
            ) : (
                <QueuePage capabilities={capabilities} />
            )}
        </Shell>
    );
}

apply();
render(<App />, document.getElementById('app')!);
