within WheelsetRig.Losses;
model WheelsetLoss "Axle bearings and brake discs of the wheelset"
  extends QuadraticLoss(c0=25.0, c1=0.6, c2=0.004);
end WheelsetLoss;
