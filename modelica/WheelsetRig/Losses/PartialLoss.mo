within WheelsetRig.Losses;
partial model PartialLoss "Slot: torque that opposes the rotation of a shaft"
  input Units.AngularVelocity omega "Angular velocity of the shaft";
  output Units.Torque tau "Loss torque, with the sign of omega";
  output Units.Power lossPower "Power turned into heat, never negative";
equation
  lossPower = tau*omega;
end PartialLoss;
