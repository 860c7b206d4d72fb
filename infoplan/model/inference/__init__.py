"""What the data say of the latent function and of the hyperparameters: exactly, or nearly."""
