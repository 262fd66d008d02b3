within TrainRig.Slots;
model UnchangedBogies "Null version: nothing changes"
  extends PartialBogies;
equation
  y = u;
  rest = restBefore;
  held = heldBefore;
end UnchangedBogies;
