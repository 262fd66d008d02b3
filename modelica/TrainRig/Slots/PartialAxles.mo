within TrainRig.Slots;
partial model PartialAxles "Slot: from a value of each axle to the one that acts, or is read"
  parameter Integer n = 8 "Axles";
  input Real u[n] "Nominal or true values";
  output Real y[n] "Values that act or are read, in the same unit";
end PartialAxles;
