"""What measures Palpebra: speed, memory, accuracy, load and attacks. No program imports it."""
