within WheelsetRig.Observers;
model Sampled "Value that is taken with a sample and held until the next"
  input Real value(unit="1") "Value to take";
  input Real period(unit="s") "Time from sample to sample";
  output Real held(unit="1", start=0.0, fixed=true) "Value of the latest sample";
equation
  der(held) = (value - held)/period;
end Sampled;
