"""Pure array functions, batched over films; numpy only."""
