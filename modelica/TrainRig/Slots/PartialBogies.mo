within TrainRig.Slots;
partial model PartialBogies "Slot: from a value of each bogie to the one that acts"
  parameter Integer n = 4 "Bogies";
  input Real u[n] "Measured values";
  output Real y[n] "Values that act, in the same unit";
end PartialBogies;
