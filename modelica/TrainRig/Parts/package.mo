within TrainRig;
package Parts "Components of the reference model"
end Parts;
