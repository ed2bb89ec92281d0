"""The actors: population encoder, synapses, spiking neurons, decoder, and the networks made of them."""
