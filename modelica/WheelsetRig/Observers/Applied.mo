within WheelsetRig.Observers;
model Applied "Friction coefficient that a sample asks for and that acts from then on"
  input Units.FrictionCoefficient value "Coefficient that is asked for";
  input Real period(unit="s") "Time from sample to sample";
  output Units.FrictionCoefficient acting(fixed=true) "Coefficient that acts";
equation
  der(acting) = (value - acting)/period;
end Applied;
