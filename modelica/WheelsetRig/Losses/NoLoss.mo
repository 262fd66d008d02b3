within WheelsetRig.Losses;
model NoLoss "Null version: no loss"
  extends PartialLoss;
equation
  tau = 0.0;
end NoLoss;
