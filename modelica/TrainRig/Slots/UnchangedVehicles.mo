within TrainRig.Slots;
model UnchangedVehicles "Null version: nothing changes"
  extends PartialVehicles;
equation
  y = u;
end UnchangedVehicles;
