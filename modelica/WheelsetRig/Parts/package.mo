within WheelsetRig;
package Parts "Bodies of the rig and where they are attached"
end Parts;
