within HeatedHouse.Interfaces;
model PromptHeater "Null version: heat arrives at once"
  extends PartialHeater;
equation
  heat = power;
end PromptHeater;
