within TrainRig.Slots;
model UnchangedPads "Null version: nothing changes"
  extends PartialPads;
equation
  y = u;
end UnchangedPads;
