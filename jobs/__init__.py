"""Programs, batches, the journal and the runner that turns events into effects. No event loop in here."""
