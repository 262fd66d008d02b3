within WheelsetRig.Losses;
model RollerLoss "Bearings and windage of the roller"
  extends QuadraticLoss(c0=40.0, c1=1.0, c2=0.02);
end RollerLoss;
